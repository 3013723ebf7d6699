"""The trace of the 1-skeleton: which potential obstacle boundaries contradict the rest of the boundary.

Section IV-A of Ramaithitima and Bhattacharya 2018 re-explores, once exploration is over, timed-out frontiers that are
inconsistent with the obstacle boundaries traced in the 1-skeleton. The paper leaves open when it is inconsistent. Here
the unresolved frontiers (timed out, or touched) are directed edges of the 1-skeleton. The boundary of an obstacle is a
closed walk of such edges, with the obstacle on its left. A closed walk has no ends. So a timed-out frontier <a, b> is
inconsistent if the boundary cannot be continued. That is so if no other unresolved frontier ends at a, or none begins
at b.
"""

from zwerm.agents.landmark_exploration.mapping.frontier_status import ABANDONED, BOUNDARY, TIMED_OUT, Frontiers, pair_of


def inconsistent(frontiers: Frontiers) -> list[int]:
    """Return the keys of the timed-out frontiers to explore once more, ascending."""
    timed_out = list(frontiers.with_status(TIMED_OUT))
    if not timed_out:
        return []
    into: dict[int, int] = {}
    out_of: dict[int, int] = {}
    for status in (TIMED_OUT, ABANDONED, BOUNDARY):
        for a, b in map(pair_of, frontiers.with_status(status)):
            out_of[a] = out_of.get(a, 0) + 1
            into[b] = into.get(b, 0) + 1
    found = []
    for key in timed_out:
        a, b = pair_of(key)
        both_sides = frontiers.statuses.get(b << 16 | a, 0) in (TIMED_OUT, ABANDONED, BOUNDARY)
        # <b, a> leads into a and out of b, but is no continuation of the walk.
        if into.get(a, 0) - both_sides < 1 or out_of.get(b, 0) - both_sides < 1:
            found.append(key)
    return found
