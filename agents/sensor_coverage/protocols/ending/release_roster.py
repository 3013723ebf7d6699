"""The base's roster: the robots that it has let out, and those of them that still stand at its own point."""

from collections.abc import Iterable

from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE, StateBeacon


class ReleaseRoster:
    """`known` are the robots that were ever in sight of the base: each robot that comes out of the depot is, at once.

    A base that has restarted knows only the robots that report to stand at its point: others may have restarted, too.
    """

    def __init__(self, first_incarnation: bool) -> None:
        self.known: dict[int, None] = {}
        self._first_incarnation = first_incarnation
        self._at_base: dict[int, None] = {}
        self._departed: dict[int, None] = {}

    @property
    def guests(self) -> tuple[int, ...]:
        """The robots that stand at the base's point, ascending."""
        return tuple(sorted(self._at_base))

    def see(self, visible: Iterable[int]) -> None:
        """Take in the visible robots."""
        for node in visible:
            if node not in self.known:
                self.known[node] = None
                if self._first_incarnation:
                    self._at_base[node] = None

    def receive(self, sender: int, state: StateBeacon) -> None:
        """Take in a robot's state: one that moves or has a slot has left the base for good."""
        if state.slot != NOWHERE or state.moving:
            self._departed[sender] = None
            self._at_base.pop(sender, None)
        elif state.waiting and sender not in self._departed:
            self._at_base[sender] = None
