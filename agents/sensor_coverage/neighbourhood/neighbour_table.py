"""A robot's table of its neighbours: their states, their directions, and its own heading.

Robots announce what they see in one frame, that of the base. Each robot knows its heading from reciprocal bearings. A
robot that comes out of the depot sees what the base sees. Every sighting names the drive after which it was made, so a
robot knows whether two views belong together.
"""

import cmath
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

import msgspec

from zwerm.agents.sensor_coverage.frontier.directions import refined_heading
from zwerm.agents.sensor_coverage.messages.beacons import FAR, NOWHERE, StateBeacon
from zwerm.agents.sensor_coverage.messages.incarnations import first_count
from zwerm.agents.sensor_coverage.neighbourhood.base_reach import BaseReach

# Bound of the ticks that a slot may take to pass from one robot to the next.
HANDOVER_TICKS_MAX: Final = 80


class NeighbourRecord(NamedTuple):
    """A visible robot: the number of its latest drive (-1: unknown), the slot that it holds, and its bearing [rad]."""

    epoch: int
    slot: int
    bearing_rad: float


class NeighbourTable:
    """One robot's table.

    `at_base`: the robot stands at the base's own point, where it came out of the depot; None while it does not know,
    which is so after a restart. `slot` is where the robot stands. `redundant`: it has left the complex, and its body
    still stands there. `reach` has the hops to the base. `epoch` counts its drives, and `samples` its averages
    of bearings. `heading` [rad] is in the base's frame, or None if unknown. `distances_m` has the distances [m] from its slot
    to others that are not a hop away, as a walk measured them. `odometry_moves` counts the robot's latest moves to slots, in
    a row and since it homed again, at whose end too few landmarks stood. `version` counts all changes: between two
    changes, no decision changes.
    """

    def __init__(self, node: int, incarnation: int = 1) -> None:
        self.node = node
        self.at_base = True if incarnation == 1 else None
        self.slot = NOWHERE
        self.redundant = False
        self.reach = BaseReach(FAR)
        self.epoch = first_count(incarnation)
        self.moving = False
        self.displaced = False
        self.heading: float | None = None
        self.samples = 0
        self.distances_m: dict[int, float] = {}
        self.odometry_moves = 0
        self.version = 0
        self.states: dict[int, StateBeacon] = {}
        self.received_at: dict[int, int] = {}  # node: tick of its latest state
        self.seen: dict[int, NeighbourRecord] = {}
        self._heard_in: dict[int, int] = {}  # node: this robot's epoch at that tick
        self._heading_readings = 0
        self._handovers: dict[int, int] = {}  # neighbouring slot that changes hands: tick since which it does
        self._backs: dict[int, tuple[int, float]] = {}  # node: this robot's epoch and direction, as that node sees it
        self._mutual: dict[int, StateBeacon] | None = None
        self._stale: tuple[tuple[int, ...], list[int]] | None = None

    def change(self) -> None:
        """Record a change, and drop what was derived from the table."""
        self.version += 1
        self._mutual = self._stale = None

    # --- neighbours' states -------------------------------------------------------------------------------------------

    def receive(self, sender: int, state: StateBeacon, tick: int) -> bool:
        """Take in a neighbour's state; return whether the average of its bearing no longer holds."""
        known = self.states.get(sender)
        self.received_at[sender] = tick
        heard_here = self._heard_in.get(sender) == self.epoch
        self._heard_in[sender] = self.epoch
        if known is not None and state.number <= known.number:
            return False
        self.change()
        self.states[sender] = state
        self._backs.pop(sender, None)
        for mine in state.seen:
            if mine.node == self.node:
                self._backs[sender] = mine.epoch, mine.direction_rad
        if state.slot in self._handovers and not state.moving:
            del self._handovers[state.slot]
        left = known is not None and (state.moving or known.slot != state.slot)
        held = known is not None and _held(known) not in (NOWHERE, self.slot) and not known.moving
        # Of a robot that was heard before this robot's latest drive, this robot may not see who takes its slot over.
        if known is not None and left and held and heard_here and sender in self.seen:
            self._handovers[known.slot] = tick
        # A robot that has just driven was perhaps averaged on its way: its neighbours do not know that it moves.
        drove = known is None or state.epoch != known.epoch or (known.moving and not state.moving)
        outdated = drove and (known is not None or state.samples == 0)
        sighting = self.seen.get(sender)
        fits = sighting is not None and (sighting.epoch == state.epoch or (sighting.epoch == -1 and not outdated))
        if sighting is not None and fits and not state.moving:
            self.seen[sender] = NeighbourRecord(state.epoch, _held(state), sighting.bearing_rad)
        if state.slot != NOWHERE:
            for node, each in self.states.items():
                if node != sender and each.slot == state.slot:  # the leader of a push has left it to its follower
                    self.states[node] = _without_slot(each)
        return outdated

    def missed(self, sender: int, state: StateBeacon) -> bool:
        """Return whether a state before this one was lost, while neither its sender nor this robot has moved."""
        known = self.states.get(sender)
        if known is None or sender not in self.seen or self._heard_in.get(sender) != self.epoch:
            return False
        stood = known.epoch == state.epoch and not (known.moving or state.moving)
        return stood and state.number > known.number + 1

    def forget(self, node: int) -> None:
        """Forget a robot that is dead or out of range."""
        self.states.pop(node, None)
        self.received_at.pop(node, None)
        self.change()

    def remove_dead(self, node: int) -> None:
        """Forget a robot that is dead."""
        self.forget(node)

    def restarted(self, node: int) -> None:
        """Forget a robot that has lost its memory, and where it was seen: it will report its slot again."""
        self.forget(node)
        self.seen.pop(node, None)
        self._backs.pop(node, None)
        self._heard_in.pop(node, None)

    def at(self, slot: int) -> int | None:
        """Return the robot at a slot, or None if this robot knows none."""
        if slot == self.slot:
            return self.node
        return next((node for node, state in self.states.items() if state.slot == slot), None)

    def slot_of(self, node: int) -> int:
        """Return the slot of a neighbour, or NOWHERE."""
        state = self.states.get(node)
        return NOWHERE if state is None else state.slot

    def note_distances(self, by_robot: Mapping[int, float]) -> None:
        """Record the distances [m] from this slot to those of other robots, as a walk to this slot measured them."""
        self.distances_m |= {slot: each for node, each in by_robot.items() if (slot := self.slot_of(node)) != NOWHERE}

    # --- this robot's drives and bearings -----------------------------------------------------------------------------

    def begin_drive(self) -> None:
        """Begin a drive: earlier bearings no longer hold."""
        self.epoch += 1
        self.moving, self.displaced = True, False
        self.samples = 0
        self.seen = {}
        self.change()

    def end_drive(self) -> None:
        """End a drive: the robot stands still."""
        self.moving = False
        self.change()

    def set_displaced(self, displaced: bool) -> None:
        """Set whether this robot was pushed so far away from its slot that it sees other walls than from there."""
        if displaced != self.displaced:
            self.displaced = displaced
            self.change()

    def update_bearings(self, bearings: Mapping[int, float]) -> None:
        """Take in averaged bearings [rad] of visible robots."""
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
        if self.slot in (0, NOWHERE) or self.heading is None:  # at the base's own point there is no bearing to the base
            return
        pairs = [(back, each.bearing_rad) for node, each in self.seen.items() if (back := self._back(node)) is not None]
        refined = refined_heading(self.heading, self._heading_readings, pairs)
        if refined is not None:
            self.heading = refined
            self._heading_readings += 1

    def find_heading(self) -> None:
        """Find the heading if it is unknown.

        A robot at the base's point and the base see the same directions. A robot that has restarted elsewhere takes it
        from reciprocal bearings, once it knows that it does not stand at the base's point.
        """
        if self.heading is not None or not self.samples:
            return
        if self.at_base:
            self._heading_of_base()
        elif self.at_base is False:
            pairs = [
                (back, each.bearing_rad) for node, each in self.seen.items() if (back := self._back(node)) is not None
            ]
            self.heading = refined_heading(0.0, 0, pairs)
            if self.heading is not None:
                self.change()

    def find_whether_at_base(self, visible: Iterable[int]) -> None:
        """After a restart, find out whether this robot stands at the base's point: the base knows the robots at its point.

        A robot there sees the base. So it waits until it has received messages of all `visible` robots.
        """
        if self.at_base is None and self.samples and all(node in self.states for node in visible):
            base = next((state for state in self.states.values() if state.slot == 0), None)
            self.at_base = base is not None and self.node in base.guests
            self.change()

    def _heading_of_base(self) -> None:
        base = next((state for state in self.states.values() if state.slot == 0), None)
        if base is None:
            return
        there = {each.node: each for each in base.seen if each.slot != NOWHERE}
        off = 0j
        for node, (epoch, _, bearing) in self.seen.items():
            if node in there and epoch == there[node].epoch != -1:
                off += cmath.exp(1j * (there[node].direction_rad - bearing))
        if off or not there:
            self.heading = cmath.phase(off) if off else 0.0
            self.change()

    def _back(self, node: int) -> float | None:
        """Return the direction [rad] in which a neighbour sees this robot where it stands now, or None."""
        state = self.states.get(node)
        if state is None or state.moving or state.slot == NOWHERE:
            return None
        if node not in self.seen or self.seen[node].epoch != state.epoch or node not in self._backs:
            return None
        epoch, direction = self._backs[node]
        return direction if epoch == self.epoch else None

    # --- agreement of views -------------------------------------------------------------------------------------------

    def mutual(self) -> dict[int, StateBeacon]:
        """Return the robots of the complex that this robot sees and that see it, both since their latest drives."""
        if self._mutual is None:
            both = [node for node in self.seen if self._back(node) is not None]
            self._mutual = {node: self.states[node] for node in both if not self.states[node].redundant}
        return self._mutual

    def stale(self, visible: Mapping[int, float]) -> list[int]:
        """Return the visible robots whose state is missing, or does not agree with this robot's view."""
        nodes = tuple(visible)
        if self._stale is not None and self._stale[0] == nodes:
            return self._stale[1]
        found = []
        mutual = self.mutual()
        for node in nodes:
            state = self.states.get(node)
            if state is None or (state.slot != NOWHERE and node not in mutual and self._back(node) is None):
                found.append(node)
        for node, state in mutual.items():
            if any(s.node in mutual and s.epoch != mutual[s.node].epoch for s in state.seen):
                found.append(node)
        self._stale = nodes, found
        return found

    @property
    def handovers_until(self) -> int | None:
        """Tick until which this robot waits for the oldest slot that changes hands, or None."""
        return min(self._handovers.values()) + HANDOVER_TICKS_MAX if self._handovers else None

    def changing(self, visible: Mapping[int, float], tick: int) -> bool:
        """Return whether slots around are changing hands, or views do not agree yet."""
        return self._changes_hands(tick) or bool(self.stale(visible))

    def settled(self, visible: Mapping[int, float], tick: int) -> bool:
        """Return whether no slot around changes hands, and views agree with those of the robots that stand still."""
        return not self._changes_hands(tick) and all(
            node in self.states and self.states[node].moving for node in self.stale(visible)
        )

    def _changes_hands(self, tick: int) -> bool:
        if not self._handovers:
            return False
        self._handovers = {slot: since for slot, since in self._handovers.items() if tick - since < HANDOVER_TICKS_MAX}
        return bool(self._handovers)


def _held(state: StateBeacon) -> int:
    """Return the slot of the complex that a robot holds."""
    return NOWHERE if state.redundant else state.slot


def _without_slot(state: StateBeacon) -> StateBeacon:
    return msgspec.structs.replace(state, slot=NOWHERE)
