"""The complex of a cycle, as the recorder gets it: by robots, not by slots."""

from collections.abc import Iterable, Mapping

from zwerm.agents.sensor_coverage.frontier.decisions import FrontierService
from zwerm.agents.sensor_coverage.frontier.plan import Plan
from zwerm.agents.sensor_coverage.messages.snapshots import ComplexSnapshot, encode_complex
from zwerm.maths.simplicial import Edge, FlagComplex


def encoded_complex(
    cycle: int, occupant: Mapping[int, int], complex_: FlagComplex, frontier: FrontierService, plans: Iterable[Plan]
) -> bytes:
    """Return the edges, the frontier and the obstacle edges of a complex, and the paths of plans; `occupant` has the robots."""

    def by_robot(edges: Iterable[Edge]) -> tuple[tuple[int, int], ...]:
        return tuple((occupant[i], occupant[j]) for i, j in edges)

    return encode_complex(
        ComplexSnapshot(
            cycle=cycle,
            edges=by_robot(complex_.edges),
            frontier=by_robot(frontier.frontier),
            obstacle=by_robot(frontier.obstacle),
            paths=tuple(tuple(occupant[each] for each in plan.path) for plan in plans),
        )
    )
