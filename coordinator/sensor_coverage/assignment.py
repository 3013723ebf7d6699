"""Assignment of deployments: the cheapest first, and at the same time all others that do not cross it."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Final

from zwerm.agents.sensor_coverage.frontier.attempt_log import AttemptLog
from zwerm.agents.sensor_coverage.frontier.decisions import FindRoutes
from zwerm.agents.sensor_coverage.frontier.paths import CheapestRoutes
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.maths.simplicial import FlagComplex

# Walks that go at once. Their slots are more than this number of edges apart: a leg has 3 m.
WALKS_MAX: Final = 6
APART_EDGES: Final = 6
# Slots for each robot that a station releases for these walks.
SLOTS_PER_WALK: Final = 60
# Leaders that wait for the robots behind them at most. Leaders begin more than this number of edges apart.
WAITING_MAX: Final = 4
LEADERS_APART_EDGES: Final = 3


class CheapestFirst:
    """Assigns the deployments with the cheapest paths, `pushes_max` at most, that do not cross.

    Each path has slots, and the slots that it uses as landmarks. Two pushes do not cross if no slot of one path is
    among those of the other. Then no robot takes a moving robot for a static landmark, and the new slots are far apart.
    Leaders of other plans drive at the same time, and wait for the robots behind them until those of the former pushes stand.

    A plan of lower priority is assigned only where no plan of higher priority is reachable in the same component of the
    complex. Walks along walls are assigned only where nothing else is, and then those that begin far apart.
    """

    def __init__(self, slots: Slots, pushes_max: int, attempts: AttemptLog) -> None:
        self._slots = slots
        self._attempts = attempts
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
            plan = next(_by_cost(wanted, routes), None)
            if plan is None or (plan.walk and chosen):
                break  # a robot that follows a wall needs standing robots around
            if plan.walk:
                return self._walks(wanted, scan, sources, find_routes)
            chosen.append(plan._replace(path=routes.path(plan.mover)))
            left = left.without(self._around(self._around(chosen[-1].path, scan), scan))
            routes = find_routes(left, {slot: cost for slot, cost in sources.items() if slot in left.neighbours})
        return (*chosen, *self._waiting(chosen, wanted, scan, sources, find_routes))

    def _waiting(
        self,
        chosen: Sequence[Plan],
        wanted: Iterable[Plan],
        scan: ScanResult,
        sources: Mapping[int, float],
        find_routes: FindRoutes,
    ) -> list[Plan]:
        """Return plans with paths from stations that cross those of the chosen ones, whose leaders can drive at the same time.

        Such a leader waits for the robots behind it, and is no landmark of the robots that move before those. It drives into a
        gap: walls stop most of these drives. Beside edges it does so only where walls stop most of these drives, too. Else the
        lattice would grow from several places, and need more robots.
        """
        beside_edges = self._attempts.walls_stop_most
        gone = [plan.path[0] for plan in chosen if plan.path[0] not in scan.bases]
        stations = {slot: cost for slot, cost in sources.items() if slot in scan.bases}
        routes = find_routes(scan.complex_.without(gone), stations)
        found, taken = list[Plan](), dict[int, None]()
        for plan in chosen:
            taken |= self._beside(plan, scan)
        for plan in _by_cost(wanted, routes):
            if plan.walk or len(found) == min(WAITING_MAX, self._pushes_max - len(chosen)):
                break
            if plan.mover not in taken and plan.mover not in scan.bases and (beside_edges or not plan.key[2]):
                found.append(plan._replace(path=routes.path(plan.mover), waits=True))
                taken |= self._beside(found[-1], scan)
        return found

    def _beside(self, plan: Plan, scan: ScanResult) -> dict[int, None]:
        """Return the slots from which no leader of a later plan may drive: close to its leader, or landmarks on its path."""
        return self._around(plan.path, scan) | within(scan.complex_, plan.mover, LEADERS_APART_EDGES)

    def _walks(
        self, wanted: Iterable[Plan], scan: ScanResult, sources: Mapping[int, float], find_routes: FindRoutes
    ) -> tuple[Plan, ...]:
        """Return the cheapest walks that begin far apart, in the order in which the robots set out.

        One robot for each `SLOTS_PER_WALK` slots comes from stations, the others from earlier walks: a single walk may close
        all that is open, and robots that have walked stay where they are. Those with the longest ways set out first: no path
        leads past a robot that waits at a wall, because it has set out before. Those whose paths do not cross set out at the
        same time.
        """
        chosen, left, apart = list[Plan](), dict(sources), list[Plan](wanted)
        released, released_max = 0, max(1, len(scan.complex_.vertices) // SLOTS_PER_WALK)
        while apart and left and len(chosen) < WALKS_MAX:
            routes = find_routes(scan.complex_, left)
            plan = next(_by_cost(apart, routes), None)
            if plan is None:
                break
            apart.remove(plan)
            path = routes.path(plan.mover)
            around = self._around([plan.mover], scan)
            if any(slot in around or slot == path[0] not in scan.bases for each in chosen for slot in each.path):
                continue
            chosen.append(plan._replace(path=path))
            if plan.meet:
                break
            released += path[0] in scan.bases
            spent = (path[0],) if path[0] not in scan.bases else scan.bases if released >= released_max else ()
            left = {slot: cost for slot, cost in left.items() if slot not in spent}
            near = within(scan.complex_, plan.mover, APART_EDGES)
            apart = [each for each in apart if each.mover not in near and not each.meet]
        found, taken = list[Plan](), dict[int, None]()
        for plan in reversed(chosen):
            waits = any(slot in taken for slot in plan.path)
            around = self._around(self._around(plan.path, scan), scan)
            taken = around if waits else taken | around
            found.append(plan._replace(waits=waits))
        return tuple(found)

    def _around(self, slots: Collection[int], scan: ScanResult) -> dict[int, None]:
        """Return the slots, and all slots that they see or remember."""
        found = dict.fromkeys(slots)
        for slot in slots:
            found |= dict.fromkeys(scan.complex_.neighbours.get(slot, ()))
            found |= dict.fromkeys(other for other, _ in self._slots.known_from(slot))
        return found


def within(complex_: FlagComplex, slot: int, edges: int) -> dict[int, None]:
    """Return the slots that a path of so many edges leads to from a slot."""
    found = ring = {slot: None}
    for _ in range(edges):
        ring = {each: None for slot in ring for each in complex_.neighbours.get(slot, ()) if each not in found}
        found = found | ring
    return found


def _by_cost(plans: Iterable[Plan], routes: CheapestRoutes) -> Iterator[Plan]:
    """Yield the plans with a path, the cheapest first, and walks after all others."""
    reached = [
        (plan.walk, routes.cost[plan.mover], plan.mover, plan.key, plan) for plan in plans if plan.mover in routes.cost
    ]
    yield from (plan for *_, plan in sorted(reached))


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
