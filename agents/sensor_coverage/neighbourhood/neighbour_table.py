"""What a robot knows of those around it: what they say, where it sees them, and its own heading.

Robots tell each other what they see in one frame, that of the base: each knows its heading from reciprocal bearings, and who
comes out of the depot sees what the base sees. Every sighting names the drive since which it holds, so that a robot knows
whether two views belong together.
"""

import cmath
import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import msgspec

from zwerm.agents.sensor_coverage.messages.peers import FAR, NOWHERE, StateBeacon

# How long a place may be on its way from one robot to the next [ticks].
AWAIT_TICKS: Final = 80


class NeighbourRecord(NamedTuple):
    """A robot as this one sees it: since which of its drives (-1: not known yet), at which place, and the bearing."""

    epoch: int
    place: int
    bearing_rad: float


class NeighbourTable:
    """One robot's. `place` is where it stands, `heading` its own in the base's frame, once known.

    `version` counts all that robots said, and all that this one saw or did: while it stands, nothing new follows.
    """

    def __init__(self, node: int) -> None:
        self.node = node
        self.place = NOWHERE
        self.spare = False  # it has left the complex, and still stands there in body
        self.home = FAR
        self.epoch = 0
        self.moving = False
        self.heading: float | None = None
        self.samples = 0
        self.version = 0
        self.states: dict[int, StateBeacon] = {}
        self.heard: dict[int, int] = {}  # node: tick
        self._heard_in: dict[int, int] = {}  # node: this robot's drive then
        self.seen: dict[int, NeighbourRecord] = {}
        self._headings = 0
        self._awaited: dict[int, int] = {}  # places beside this one that change hands, and since when
        self._backs: dict[int, tuple[int, float]] = {}  # node: for which drive of this robot, and where it sees it
        self._mutual: dict[int, StateBeacon] | None = None
        self._stale: tuple[tuple[int, ...], list[int]] | None = None

    def change(self) -> None:
        """Take note that something is new."""
        self.version += 1
        self._mutual = self._stale = None

    # --- what others say --------------------------------------------------------------------------------------------

    def hear(self, sender: int, state: StateBeacon, tick: int) -> bool:
        """Take in a neighbour's state; tell whether its bearing so far holds no more."""
        known = self.states.get(sender)
        self.heard[sender] = tick
        self._heard_in[sender] = self.epoch
        if known is not None and state.number <= known.number:
            return False
        self.change()
        self.states[sender] = state
        self._backs.pop(sender, None)
        for mine in state.seen:
            if mine.node == self.node:
                self._backs[sender] = mine.epoch, mine.direction_rad
        if state.place in self._awaited and not state.moving:
            del self._awaited[state.place]
        left = known is not None and (state.moving or known.place != state.place)
        held = known is not None and _held(known) != NOWHERE and not known.moving
        if known is not None and left and held and sender in self.seen:
            self._awaited[known.place] = tick
        sighting = self.seen.get(sender)
        if sighting is not None and not state.moving and sighting.epoch in (-1, state.epoch):
            self.seen[sender] = NeighbourRecord(state.epoch, _held(state), sighting.bearing_rad)
        if state.place != NOWHERE:
            for node, each in self.states.items():
                if node != sender and each.place == state.place:  # who leads a push has left it to its follower
                    self.states[node] = _elsewhere(each)
        if known is None:
            return state.samples == 0
        return bool(state.epoch != known.epoch or (known.moving and not state.moving))

    def missed(self, sender: int, state: StateBeacon) -> bool:
        """Tell whether a state before this one was lost: neither its sender nor this robot has moved meanwhile."""
        known = self.states.get(sender)
        if known is None or sender not in self.seen or self._heard_in.get(sender) != self.epoch:
            return False
        stood = known.epoch == state.epoch and not (known.moving or state.moving)
        return stood and state.number > known.number + 1

    def forget(self, node: int) -> None:
        """Forget a robot that is dead or far away."""
        self.states.pop(node, None)
        self.heard.pop(node, None)
        self.change()

    def at(self, place: int) -> int | None:
        """Return who stands at a place, as far as this robot has heard."""
        if place == self.place:
            return self.node
        return next((node for node, state in self.states.items() if state.place == place), None)

    def go(self) -> None:
        """Begin a drive: what was seen holds no more."""
        self.epoch += 1
        self.moving = True
        self.samples = 0
        self.seen = {}
        self.change()

    def rest(self) -> None:
        """Stand again."""
        self.moving = False
        self.change()

    # --- what this robot sees ---------------------------------------------------------------------------------------

    def look(self, bearings: Mapping[int, float]) -> None:
        """Take what this robot sees, averaged."""
        self.seen = {}
        for node, bearing in bearings.items():
            state = self.states.get(node)
            if state is None or state.moving:
                self.seen[node] = NeighbourRecord(-1, NOWHERE, bearing)
            else:
                self.seen[node] = NeighbourRecord(state.epoch, _held(state), bearing)
        self.samples += 1
        self.change()
        self._learn_heading()

    def _learn_heading(self) -> None:
        """Refine the heading by reciprocal bearings."""
        if self.place in (0, NOWHERE) or self.heading is None:  # on top of the base there is no bearing to it
            return
        off = 0j
        for node, (_, _, bearing) in self.seen.items():
            back = self._back(node)
            if back is not None:
                off += cmath.exp(1j * (back + math.pi - self.heading - bearing))
        if off:
            self.heading += cmath.phase(off) / min(self._headings + 1, 20)
            self._headings += 1

    def find_heading(self) -> None:
        """Take the heading from the base, if this robot stands there: it sees what the base sees."""
        base = next((state for state in self.states.values() if state.place == 0), None)
        if base is None or self.heading is not None or not self.samples:
            return
        there = {each.node: each for each in base.seen if each.place != NOWHERE}
        off = 0j
        for node, (epoch, _, bearing) in self.seen.items():
            if node in there and epoch == there[node].epoch != -1:
                off += cmath.exp(1j * (there[node].direction_rad - bearing))
        if off or not there:
            self.heading = cmath.phase(off) if off else 0.0
            self.change()

    def _back(self, node: int) -> float | None:
        """Return the direction in which a neighbour sees this robot where it stands now."""
        state = self.states.get(node)
        if state is None or state.moving or state.place == NOWHERE:
            return None
        if node not in self.seen or self.seen[node].epoch != state.epoch or node not in self._backs:
            return None
        epoch, direction = self._backs[node]
        return direction if epoch == self.epoch else None

    def mutual(self) -> dict[int, StateBeacon]:
        """Return the robots of the complex that see this one and are seen by it, both since they last moved."""
        if self._mutual is None:
            both = [node for node in self.seen if self._back(node) is not None]
            self._mutual = {node: self.states[node] for node in both if not self.states[node].spare}
        return self._mutual

    def stale(self, sight: Mapping[int, float]) -> list[int]:
        """Return the robots in sight whose word is missing, or does not fit what this robot sees; it should wait for them."""
        nodes = tuple(sight)
        if self._stale is not None and self._stale[0] == nodes:
            return self._stale[1]
        found = []
        mutual = self.mutual()
        for node in nodes:
            state = self.states.get(node)
            if state is None or (state.place != NOWHERE and node not in mutual and self._back(node) is None):
                found.append(node)
        for node, state in mutual.items():
            if any(s.node in mutual and s.epoch != mutual[s.node].epoch for s in state.seen):
                found.append(node)
        self._stale = nodes, found
        return found

    @property
    def awaits_until(self) -> int | None:
        """When it waits no more for places that change hands."""
        return min(self._awaited.values()) + AWAIT_TICKS if self._awaited else None

    def changing(self, sight: Mapping[int, float], tick: int) -> bool:
        """Tell whether robots around are on their way: what this robot sees is then no picture of places."""
        self._awaited = {place: since for place, since in self._awaited.items() if tick - since < AWAIT_TICKS}
        return bool(self._awaited) or bool(self.stale(sight))


def _held(state: StateBeacon) -> int:
    """Return the place of the complex that a robot holds."""
    return NOWHERE if state.spare else state.place


def _elsewhere(state: StateBeacon) -> StateBeacon:
    return msgspec.structs.replace(state, place=NOWHERE)
