"""Who expands next: the cheapest first, and at once all others that do not cross it."""

from collections.abc import Collection, Iterable, Mapping, Sequence

from zwerm.agents.sensor_coverage.frontier.paths import Reach
from zwerm.agents.sensor_coverage.frontier.services import Plan, ScanResult, Ways
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.maths.simplicial import FlagComplex


class CheapestFirst:
    """The deployments with the cheapest paths, as many at once as do not cross, `pushes_max` at most.

    Two pushes do not cross if no place of one's path has a landmark, or is one, that the other's has or is: nobody takes a
    moving robot for a standing one, and their new places are far apart. What is less wanted is assigned only where nothing
    that is wanted more can be reached in the same piece of the complex.
    """

    def __init__(self, places: Slots, pushes_max: int) -> None:
        self._places = places
        self._pushes_max = pushes_max

    def assign(
        self, plans: Iterable[Sequence[Plan]], picture: ScanResult, sources: Mapping[int, float], ways: Ways
    ) -> tuple[Plan, ...]:
        """Return the plans to carry out at once, with their paths; none if no path leads to any."""
        reach = ways(picture.complex_, sources)
        if not reach.cost:
            return ()
        wanted = _wanted(plans, reach, picture.complex_)
        left, chosen = picture.complex_, list[Plan]()
        while len(chosen) < self._pushes_max:
            reached = [
                (reach.cost[plan.mover], plan.mover, plan.key, plan) for plan in wanted if plan.mover in reach.cost
            ]
            if not reached:
                break
            plan = min(reached)[-1]
            chosen.append(plan._replace(path=reach.path(plan.mover)))
            left = left.without(self._around(self._around(chosen[-1].path, picture), picture))
            reach = ways(left, {place: cost for place, cost in sources.items() if place in left.neighbours})
        return tuple(chosen)

    def _around(self, places: Collection[int], picture: ScanResult) -> Collection[int]:
        """Return the places, and all that they see or remember."""
        found = dict.fromkeys(places)
        for place in places:
            found |= dict.fromkeys(picture.complex_.neighbours.get(place, ()))
            found |= dict.fromkeys(other for other, _ in self._places.known_from(place))
        return found


def _wanted(plans: Iterable[Sequence[Plan]], reach: Reach, complex_: FlagComplex) -> list[Plan]:
    """Return, for each piece of the complex, the plans wanted most of which any can be reached."""
    piece = {place: number for number, each in enumerate(complex_.components()) for place in each}
    open_pieces = dict.fromkeys(piece[place] for place in reach.cost)
    found: list[Plan] = []
    for tier in plans:
        reached = [plan for plan in tier if plan.mover in reach.cost and piece[plan.mover] in open_pieces]
        found += reached
        for plan in reached:
            open_pieces.pop(piece[plan.mover], None)
        if not open_pieces:
            break
    return found
