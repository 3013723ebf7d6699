"""Points of walks that a robot keeps until its proof of coverage can take them.

A robot that has just taken a slot over has no averaged view, and its neighbours' states do not agree with it yet. A walk
often begins at that slot at once, and its first points close the arc that the walk was made for.

A point names robots, and holds for the places where they stood. So a robot counts only if it still is at the same slot
after the same drive.
"""

from collections import deque
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple, Protocol

from zwerm.agents.sensor_coverage.messages.beacons import StateBeacon
from zwerm.agents.sensor_coverage.messages.walls import PassedPoint

# Number of points that are kept: a neighbour that may be dead delays the agreement of views for 308 ticks.
KEPT_MAX: Final = 400


class Place(NamedTuple):
    """Where a robot stands: its slot, and the number of its latest drive."""

    slot: int
    epoch: int


class Neighbourhood(Protocol):
    """Where a robot and its neighbours stand, as far as it knows."""

    node: int
    slot: int
    epoch: int
    states: dict[int, StateBeacon]

    def mutual(self) -> Mapping[int, StateBeacon]:
        """Return the states of the robots that this robot sees and that see it."""


class _Kept(NamedTuple):
    sender: int
    passed: PassedPoint
    places: Mapping[int, Place]


class KeptPoints:
    """The points of walks that one robot keeps, in the order in which they were received."""

    def __init__(self) -> None:
        self._points: deque[_Kept] = deque(maxlen=KEPT_MAX)

    def __bool__(self) -> bool:
        return bool(self._points)

    def keep(self, sender: int, passed: PassedPoint, here: Neighbourhood) -> None:
        """Keep a point, and where the robots stand now that it names."""
        named = (*(node for node, _ in passed.seen), *passed.robots)
        places = {
            node: Place(state.slot, state.epoch)
            for node in named
            if (state := here.states.get(node)) is not None and not (state.moving or state.displaced)
        }
        self._points.append(_Kept(sender, passed, places | {here.node: Place(here.slot, here.epoch)}))

    def forget(self, sender: int) -> None:
        """Drop the points of one walking robot."""
        self._points = deque((each for each in self._points if each.sender != sender), KEPT_MAX)

    def take(self, here: Neighbourhood) -> Iterator[tuple[int, PassedPoint, dict[int, int]]]:
        """Yield and drop all points: the walking robot, the point, and the slots of the robots that stand where they stood."""
        now = {node: Place(state.slot, state.epoch) for node, state in here.mutual().items()}
        now[here.node] = Place(here.slot, here.epoch)
        while self._points:
            sender, passed, places = self._points.popleft()
            yield sender, passed, {node: place.slot for node, place in now.items() if places.get(node) == place}
