"""One team of all robots, which the coordinator leads: the robots' messages to it, and its messages to them.

The coordinator makes a view of all robots whose beacons it receives. A robot takes every later view that includes it, and
founds none. It waits while it receives nothing.
"""

from zwerm.agents.robot_teams.protocols.team_membership import TeamMembership, later
from zwerm.agents.robot_teams.protocols.team_messages import TeamBeacon, View


class CoordinatedMembership(TeamMembership):
    """A robot's view of the coordinator's team. All that it receives comes from the coordinator."""

    @property
    def leads(self) -> bool:
        """Never: the coordinator decides."""
        return False

    def accepts(self, sender: int) -> bool:
        """Return whether facts and plans of a sender are taken over: those of the coordinator are."""
        return True

    def receive(self, beacon: TeamBeacon, tick: int, near: bool) -> None:
        """Receive the coordinator's beacon."""
        self._receive_statuses(beacon, tick)
        for view in beacon.views:
            self._latest_epoch = max(self._latest_epoch, view.epoch)
            if self.node in view.members and later(view, self.view):
                self._adopt(view, tick)

    def meet_first(self, tick: int) -> None:
        """Wait for the coordinator's view."""

    def poll(self, tick: int) -> None:
        """Drop no member: the coordinator does."""


class CoordinatorMembership(TeamMembership):
    """The coordinator's view: all robots whose beacons it receives. It is no member itself."""

    def __init__(self, node: int, dt_s: float, silence_s: float) -> None:
        super().__init__(node, dt_s, silence_s)
        self.view = View(1, node, ())

    def accepts(self, sender: int) -> bool:
        """Return whether facts of a sender are taken over: those of all robots are."""
        return True

    def receive(self, beacon: TeamBeacon, tick: int, near: bool) -> None:
        """Receive a robot's beacon."""
        self._receive_statuses(beacon, tick)
        for view in beacon.views:
            self._latest_epoch = max(self._latest_epoch, view.epoch)

    def poll(self, tick: int) -> None:
        """Add robots whose beacons it receives, and drop silent ones. Plans hold within a view: robots finish theirs first."""
        received = [
            node for node in sorted(self.roster.statuses) if self.roster.silent_ticks(node, tick) <= self._silence_ticks
        ]
        if tuple(received) != self.view.members:
            self._adopt(View(self._latest_epoch + 1, self.node, tuple(received)), tick)
