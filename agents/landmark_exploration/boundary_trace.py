"""The trace of the 1-skeleton: which potential obstacle boundaries contradict the rest of the boundary.

Section IV-A of Ramaithitima and Bhattacharya 2018 re-explores, once exploration is over, timed-out frontiers that are
inconsistent with the obstacle boundaries traced in the 1-skeleton. What inconsistent means is left open there. Here: the
unresolved frontiers (timed out, or touched) are directed edges of the 1-skeleton, and the boundary of an obstacle is a
closed walk of such edges, the obstacle always to the left. A timed-out frontier is consistent iff it lies on a closed walk with a
frontier at which an obstacle was touched: iff both its landmarks are in one strongly connected component that has one.
"""

from zwerm.agents.landmark_exploration.frontier import ABANDONED, BOUNDARY, TIMED_OUT, Frontiers, pair_of


def inconsistent(frontiers: Frontiers) -> list[int]:
    """Return the keys of the timed-out frontiers to explore once more, ascending."""
    timed_out = list(frontiers.with_status(TIMED_OUT))
    touched = list(frontiers.with_status(BOUNDARY))
    if not timed_out:
        return []
    edges = sorted([*timed_out, *touched, *frontiers.with_status(ABANDONED)])
    component = components([pair_of(key) for key in edges])
    with_obstacle = {component[a] for a, b in map(pair_of, touched) if component[a] == component[b]}
    return [
        key
        for key in timed_out
        for a, b in [pair_of(key)]
        if component[a] != component[b] or component[a] not in with_obstacle
    ]


def components(edges: list[tuple[int, int]]) -> dict[int, int]:
    """Return the strongly connected component of every vertex (Tarjan 1972, without recursion)."""
    following: dict[int, list[int]] = {}
    for a, b in edges:
        following.setdefault(a, []).append(b)
        following.setdefault(b, [])
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    component: dict[int, int] = {}
    stack: list[int] = []
    for root in following:
        if root in index:
            continue
        work = [(root, iter(following[root]))]
        index[root] = low[root] = len(index)
        stack.append(root)
        while work:
            vertex, rest = work[-1]
            for other in rest:
                if other not in index:
                    index[other] = low[other] = len(index)
                    stack.append(other)
                    work.append((other, iter(following[other])))
                    break
                if other not in component:
                    low[vertex] = min(low[vertex], index[other])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[vertex])
                if low[vertex] == index[vertex]:
                    while True:
                        each = stack.pop()
                        component[each] = index[vertex]
                        if each == vertex:
                            break
    return component
