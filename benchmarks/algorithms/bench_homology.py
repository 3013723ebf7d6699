"""Processor time to find redundant robots by relative H2, and correctness of the certificates.

Random swarms in a square whose border is the fence, about 1.6 robots per cell of 0.4 r_v. Prints the processor time to
build the complex and to find the redundant robots with their certificate. Beside it stands the time of gudhi for the
Betti numbers of the same pair. Then checks the certificates of random complexes against gudhi.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable, Sequence

import gudhi
import numpy as np

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.maths.simplicial import Edge, FlagComplex, RedundantVertices, edge, find_redundant, relative_cycles

TARGET_S = 1.0
CELL = 0.4


def swarm(cells: int, seed: int, blind_fraction: float = 0.0) -> tuple[dict[int, list[int]], list[Edge]]:
    """Return the neighbour lists of one robot in each of cells x cells and of the robots of the fence, and the fence.

    `blind_fraction` of all pairs do not see each other, though they are near; those of the fence always do.
    """
    random = np.random.default_rng(seed)
    side = CELL * cells
    around = 4 * math.ceil(side / 0.8)
    corners = np.array([[0, 0], [side, 0], [side, side], [0, side], [0, 0]])
    along = np.linspace(0, 4, around, endpoint=False)
    border = np.stack([np.interp(along, np.arange(5), corners[:, axis]) for axis in (0, 1)], axis=1)
    grid = np.stack(np.meshgrid(np.arange(cells), np.arange(cells)), axis=-1).reshape(-1, 2) * CELL
    position = np.vstack([border, grid + random.uniform(0.0, CELL, (cells * cells, 2))])
    apart = np.hypot(*(position[:, None] - position[None, :]).transpose(2, 0, 1))
    blind = np.triu(random.uniform(size=apart.shape) < blind_fraction)
    near = (apart <= 1.0) & ~np.eye(len(position), dtype=bool) & ~(blind | blind.T)
    fence = [edge(n, (n + 1) % around) for n in range(around)]
    for i, j in fence:
        near[i, j] = near[j, i] = True
    return {n: np.flatnonzero(row).tolist() for n, row in enumerate(near)}, fence


def by_gudhi(complex_: FlagComplex, fence: Sequence[Edge] = ()) -> list[int]:
    """Return the Betti numbers b0, b1, b2 of the complex with a cone over the fence: b2 is that of the pair."""
    tree, apex = gudhi.SimplexTree(), max(complex_.vertices, default=0) + 1
    for simplex in (*((v,) for v in complex_.vertices), *complex_.edges, *complex_.triangles):
        tree.insert(list(simplex))
    for i, j in fence:
        tree.insert([i, j, apex])
    tree.compute_persistence(homology_coeff_field=2, persistence_dim_max=True)
    return [*tree.betti_numbers(), 0, 0, 0][:3]


def timed(make: Callable[[], object], repeats: int) -> float:
    """Return the median processor time of a call [s]."""
    spent = []
    for _ in range(repeats):
        start = time.process_time()
        make()
        spent.append(time.process_time() - start)
    return statistics.median(spent)


def holds(complex_: FlagComplex, fence: Sequence[Edge], found: RedundantVertices) -> bool:
    """Return whether a certificate is valid, and gudhi confirms that b0 and b1 stay without the redundant robots."""
    odd: dict[Edge, int] = {}
    for i, j, k in found.cycle:
        for each in ((i, j), (i, k), (j, k)):
            odd[each] = odd.get(each, 0) ^ 1
    closed = sorted(each for each, parity in odd.items() if parity) == sorted(found.boundary)
    within = set(found.boundary) <= set(fence) and not {v for each in found.cycle for v in each} & set(found.redundant)
    as_many = len(relative_cycles(complex_, fence)[0]) == by_gudhi(complex_, fence)[2]
    return closed and within and as_many and by_gudhi(complex_.without(found.redundant))[:2] == by_gudhi(complex_)[:2]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--complexes", type=int, default=1000)
    parser.add_argument("--certificates", action="store_true", help="only the certificates")
    add_csv_option(parser)
    arguments = parser.parse_args()
    rows = []
    print(f"median of {arguments.repeats}, processor time")
    print(
        f"{'robots':>6} {'triangles':>9} {'complex s':>10} {'redundant':>7} {'relative H2 s':>14} {'target':>7} {'gudhi s':>8}"
    )
    for cells in () if arguments.certificates else (15, 21, 31, 44):
        lists, fence = swarm(cells, 1)
        complex_ = FlagComplex(lists)
        build_s = timed(lambda lists=lists: FlagComplex(lists), arguments.repeats)
        spent_s = timed(lambda pair=(complex_, fence): find_redundant(*pair), arguments.repeats)
        gudhi_s = timed(lambda pair=(complex_, fence): by_gudhi(*pair), arguments.repeats)
        redundant, target = len(find_redundant(complex_, fence).redundant), f"{TARGET_S:g}" if cells == 31 else ""
        print(
            f"{len(lists):>6} {len(complex_.triangles):>9} {build_s:>10.3f} {redundant:>7} {spent_s:>14.3f} {target:>7} "
            f"{gudhi_s:>8.3f}"
        )
        rows.append(
            {
                "robots": f"{len(lists)}",
                "triangles": f"{len(complex_.triangles)}",
                "build the complex [s]": f"{build_s:.3f}",
                "redundant": f"{redundant}",
                "relative H2 [s]": f"{spent_s:.3f}",
                "at most [s]": target,
                "gudhi, same run [s]": f"{gudhi_s:.3f}",
            }
        )
    good = certified = redundant = 0
    for seed in range(arguments.complexes):
        lists, fence = swarm(3 + seed % 4, seed, blind_fraction=0.1 * (seed % 3))
        complex_ = FlagComplex(lists)
        found = find_redundant(complex_, fence)
        certified += bool(found.cycle)
        redundant += len(found.redundant)
        good += holds(complex_, fence, found)
    print(
        f"certificates: {certified} of {arguments.complexes} complexes, {redundant} redundant robots; gudhi agrees on {good}"
    )
    if arguments.certificates:
        counts = {"complexes": arguments.complexes, "with a certificate": certified, "redundant robots": redundant}
        rows = [{name: f"{count}" for name, count in (counts | {"gudhi agrees": good}).items()}]
    write_csv(arguments.csv, rows)


if __name__ == "__main__":
    main()
