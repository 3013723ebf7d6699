"""Assignment of deployments: the cheapest first, and at the same time all others that do not cross it."""

from collections.abc import Collection, Iterable, Mapping, Sequence

from zwerm.agents.sensor_coverage.frontier.decisions import FindRoutes
from zwerm.agents.sensor_coverage.frontier.paths import CheapestRoutes
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.maths.simplicial import FlagComplex


class CheapestFirst:
    """Assigns the deployments with the cheapest paths, `pushes_max` at most, that do not cross.

    Each path has slots, and the slots that it uses as landmarks. Two pushes do not cross if no slot of one path is
    among those of the other. Then no robot takes a moving robot for a static landmark, and the new slots are far apart.
    A plan of lower priority is assigned only where no plan of higher priority is reachable in the same component of the
    complex. A walk along a wall is assigned alone.
    """

    def __init__(self, slots: Slots, pushes_max: int) -> None:
        self._slots = slots
        self._pushes_max = pushes_max

    def assign(
        self, plans: Iterable[Sequence[Plan]], scan: ScanResult, sources: Mapping[int, float], find_routes: FindRoutes
    ) -> tuple[Plan, ...]:
        """Return the plans to carry out concurrently, with their paths; an empty tuple if no plan has a path."""
        routes = find_routes(scan.complex_, sources)
        if not routes.cost:
            return ()
        wanted = _wanted(plans, routes, scan.complex_)
        left, chosen = scan.complex_, list[Plan]()
        while len(chosen) < self._pushes_max:
            reached = [
                (plan.walk, routes.cost[plan.mover], plan.mover, plan.key, plan)
                for plan in wanted
                if plan.mover in routes.cost
            ]
            if not reached:
                break
            plan = min(reached)[-1]
            if plan.walk and chosen:
                break  # a robot that follows a wall needs standing robots around
            chosen.append(plan._replace(path=routes.path(plan.mover)))
            if plan.walk:
                break
            left = left.without(self._around(self._around(chosen[-1].path, scan), scan))
            routes = find_routes(left, {slot: cost for slot, cost in sources.items() if slot in left.neighbours})
        return tuple(chosen)

    def _around(self, slots: Collection[int], scan: ScanResult) -> Collection[int]:
        """Return the slots, and all slots that they see or remember."""
        found = dict.fromkeys(slots)
        for slot in slots:
            found |= dict.fromkeys(scan.complex_.neighbours.get(slot, ()))
            found |= dict.fromkeys(other for other, _ in self._slots.known_from(slot))
        return found


def _wanted(plans: Iterable[Sequence[Plan]], routes: CheapestRoutes, complex_: FlagComplex) -> list[Plan]:
    """Return, for each component of the complex, its reachable plans of the highest priority."""
    piece = {slot: number for number, each in enumerate(complex_.components()) for slot in each}
    open_pieces = dict.fromkeys(piece[slot] for slot in routes.cost)
    found: list[Plan] = []
    for tier in plans:
        reached = [plan for plan in tier if plan.mover in routes.cost and piece[plan.mover] in open_pieces]
        found += reached
        for plan in reached:
            open_pieces.pop(piece[plan.mover], None)
        if not open_pieces:
            break
    return found
