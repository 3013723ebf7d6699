"""A robot's knowledge of its teammates in one corridor, from their statuses. Lost messages only delay it."""

from collections.abc import Callable

from zwerm.agents.robot_teams.protocols.team_membership import TeamMembership
from zwerm.agents.robot_teams.protocols.team_messages import HUNTS, READY, CorridorPlan, Status


class CorridorMates:
    """A robot's knowledge of its teammates in one corridor, from their statuses."""

    def __init__(
        self, plan: CorridorPlan, node: int, membership: TeamMembership, sweeping: Callable[[int], bool]
    ) -> None:
        self._plan, self._node, self._membership = plan, node, membership
        self.sweeping = sweeping

    def _statuses(self) -> list[Status]:
        plan, statuses = self._plan, self._membership.roster.statuses
        found = [statuses[node] for node in plan.order if node != self._node and node in statuses]
        return [status for status in found if (status.epoch, status.number) == (plan.epoch, plan.number)]

    def slot(self, room: int | None) -> int:
        """Return the slice of the corridor that this robot takes, given the number of robots it found room for;
        negative for none."""
        rooms = [status.room for status in self._statuses() if status.room is not None]
        if room is not None:
            rooms.append(room)
        order = self._plan.order
        return order.index(self._node) - max(0, len(order) - min(rooms, default=len(order)))

    def claimed(self, k: int) -> bool:
        """Return whether a teammate takes slice k in this corridor."""
        return any(status.claim == k for status in self._statuses())

    def awaits_predecessor(self) -> bool:
        """Return whether the predecessor has not swept its slice yet."""
        order, plan = self._plan.order, self._plan
        index = order.index(self._node) - 1
        if index < 0 or order[index] not in self._membership.view.members:
            return False
        status = self._membership.roster.statuses.get(order[index])
        if status is None or (status.epoch, status.number) < (plan.epoch, plan.number):
            return True
        return (status.epoch, status.number) == (plan.epoch, plan.number) and status.phase not in (HUNTS, READY)
