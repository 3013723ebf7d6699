"""Betti numbers of a complex given by its maximal simplices, after it was collapsed.

A vertex is dominated if another one is in every maximal simplex that contains it. Its removal keeps the homotopy type
(Barmak and Minian 2012). The same holds for maximal simplices, seen as the vertices of the dual complex (Dowker 1952).
The remainder of a complex that covers an area is little more than a cycle around each hole.
"""

from collections.abc import Iterable
from itertools import combinations


def collapsed(simplices: Iterable[Iterable[int]]) -> list[tuple[int, ...]]:
    """Return maximal simplices of a complex of the same homotopy type, without dominated vertices."""
    members = {n: set(each) for n, each in enumerate(sorted({tuple(sorted(set(each))) for each in simplices})) if each}
    holders: dict[int, set[int]] = {}
    for n, each in members.items():
        for vertex in sorted(each):
            holders.setdefault(vertex, set()).add(n)
    changed = True
    while changed:
        changed = _remove_dominated(members, holders)
        changed = _remove_dominated(holders, members) or changed
    return sorted(tuple(sorted(each)) for each in members.values())


def _remove_dominated(rows: dict[int, set[int]], columns: dict[int, set[int]]) -> bool:
    """Remove every row that another row contains; return whether there was one. `columns` are the same, transposed."""
    removed = False
    queue = sorted(rows)
    for n in queue:
        row = rows[n]
        rarest = min(row, key=lambda column: (len(columns[column]), column))
        if any(other != n and row <= rows[other] for other in columns[rarest]):
            for column in row:
                columns[column].discard(n)
            del rows[n]
            removed = True
    return removed


def betti(simplices: Iterable[Iterable[int]]) -> tuple[int, int]:
    """Return the Betti numbers (b0, b1) over Z2 of the complex with these maximal simplices."""
    maximal = collapsed(simplices)
    vertices = sorted({vertex for each in maximal for vertex in each})
    edges = sorted({pair for each in maximal for pair in combinations(each, 2)})
    triangles = sorted({triple for each in maximal for triple in combinations(each, 3)})
    number = {vertex: 1 << n for n, vertex in enumerate(vertices)}
    edge_rank = _rank(number[a] | number[b] for a, b in edges)
    bit = {pair: 1 << n for n, pair in enumerate(edges)}
    triangle_rank = _rank(bit[a, b] | bit[a, c] | bit[b, c] for a, b, c in triangles)
    return len(vertices) - edge_rank, len(edges) - edge_rank - triangle_rank


def _rank(columns: Iterable[int]) -> int:
    """Return the rank over Z2 of columns given as bits."""
    pivots: dict[int, int] = {}
    for column in columns:
        while column:
            known = pivots.get(column.bit_length())
            if known is None:
                pivots[column.bit_length()] = column
                break
            column ^= known
    return len(pivots)
