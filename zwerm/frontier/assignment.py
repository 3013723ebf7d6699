"""Who expands next: the cheapest first."""

from collections.abc import Iterable, Mapping, Sequence

from zwerm.frontier.services import Picture, Plan, Ways


class CheapestFirst:
    """The deployment with the cheapest path, among those wanted most of which any can be reached."""

    def assign(
        self, plans: Iterable[Sequence[Plan]], picture: Picture, sources: Mapping[int, float], ways: Ways
    ) -> tuple[Plan, ...]:
        """Return the cheapest plan, with its path; none if no path leads to any."""
        reach = ways(picture.complex_, sources)
        for wanted in plans:
            reached = [
                (reach.cost[plan.mover], plan.mover, plan.key, plan) for plan in wanted if plan.mover in reach.cost
            ]
            if reached:
                plan = min(reached)[-1]
                return (plan._replace(path=reach.path(plan.mover)),)
        return ()
