"""Walks without a coordinator: the walking robot announces its way, and the robots that it passes prove their slots.

Each robot that a point of the walk names takes the point into the proof of its own slot, and answers if that closed
something. A robot whose view is not complete yet keeps the points until it is. The end of a walk is flooded, because the
walking robot is out of range of its push by then. A lost message leaves an arc open, which is tried again.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import ClassVar, Final, NamedTuple, Protocol

from zwerm.agents.sensor_coverage.frontier.decisions import SlotCoverageProof
from zwerm.agents.sensor_coverage.frontier.directions import wrapped
from zwerm.agents.sensor_coverage.frontier.strips.stretches import StretchTracker
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    BLIND_MAX,
    SeenPoint,
    WalkPoint,
    WallStep,
    leaves_wall,
    mark_of,
    point_before,
    turned_vector,
)
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.messages.walls import (
    ArcClosed,
    DeadInSight,
    NeighbourProved,
    PassedPoint,
    WalkMessage,
    WalkOver,
)
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.agents.sensor_coverage.protocols.walls.kept_points import KeptPoints, Neighbourhood
from zwerm.agents.sensor_coverage.protocols.walls.sightlines import RESENT_POINTS, Sightlines
from zwerm.agents.sensor_coverage.protocols.walls.wall_records import message_of, proved_arc, stretch_of

# A robot makes plans again this many ticks after the latest point that closed something: the walk has passed.
PASSED_TICKS: Final = 10


class ProvedSlot(Neighbourhood, Protocol):
    """What a robot knows of its slot, its neighbours, and the proof of coverage there."""

    moving: bool
    redundant: bool
    displaced: bool
    heading: float | None
    proof: SlotCoverageProof

    def update_proof(self) -> None:
        """Take the present view into the proof."""

    def replan(self) -> None:
        """Make plans again."""


class StepReporter(Protocol):
    """A walk that reports each of its points to `on_step`."""

    on_step: Callable[[Waypoint], None]

    @property
    def radius_m(self) -> float:
        """The radius [m] of the robot's body."""


class WalkSituation(Protocol):
    """The part of a robot's situation that walks depend on."""

    @property
    def wall_walk(self) -> StepReporter:
        """The robot's own walk."""

    @property
    def dead(self) -> Collection[int]:
        """The robots that this robot has found to be dead."""

    @property
    def said_dead(self) -> dict[int, None]:
        """The robots that others have found to be dead, for the present walk."""

    @property
    def told_dead(self) -> tuple[int, ...]:
        """The robots that are dead by the latest wave of the census."""

    @property
    def node(self) -> int:
        """The robot's id."""

    @property
    def local_map(self) -> ProvedSlot:
        """The robot's slot and its neighbours."""

    @property
    def settled(self) -> bool:
        """True if the robot stands still, and its view agrees with the states of all robots that do."""


class _Received(NamedTuple):
    """The latest point that was received from a walking robot, its step, and the slot where it was received."""

    push: int
    slot: int
    seen: SeenPoint
    step: WallStep


class WallProtocol(Component):
    """One robot's part in walks, its own and those of others."""

    channel: ClassVar[str] = CHANNEL
    accepts: ClassVar[tuple[type, ...]] = (PassedPoint, ArcClosed, NeighbourProved, DeadInSight, WalkOver)

    def __init__(self, situation: WalkSituation, on_over: Callable[[int], None] = lambda _: None) -> None:
        """Call `on_over` with the number of the push when a walk has ended."""
        self._situation = situation
        self._on_over = on_over
        self._outbox: list[Outgoing] = []
        self._push: int | None = None  # the push of this robot's own walk
        self._hand = 1
        self._number = 0
        self._stretches, self._sightlines = StretchTracker(1, 0.0), Sightlines()
        self._closed = False
        self._received: dict[int, _Received] = {}
        self._kept = KeptPoints()
        self._replan_at: int | None = None
        self._over: dict[int, None] = {}
        self._ended: list[WalkOver] = []  # walks that have ended while points were kept
        self._latest: Waypoint | None = None
        self._warned: dict[tuple[int, int], None] = {}  # (push, dead robot) that the walking robot was told

    # --- this robot's own walk ----------------------------------------------------------------------------------------

    def begin(self, push: int, hand: int) -> None:
        """Announce the points of the walk that begins now."""
        if push != self._push:
            self._push, self._hand, self._number = push, hand, 0
            self._stretches = StretchTracker(hand, self._situation.wall_walk.radius_m)
            self._sightlines = Sightlines()
            self._latest = None
            self._situation.said_dead.clear()
        self._closed = False
        self._situation.wall_walk.on_step = self._announce

    def has_closed(self) -> bool:
        """Return whether a robot answered since the latest `begin` that an open arc became smaller."""
        return self._closed

    def end(self, push: int) -> None:
        """Announce that the walk is over, and which walls were followed."""
        self._push = None
        self._situation.wall_walk.on_step = lambda _: None
        last = self._stretches.latest
        reaches_end = last is not None and last.last_number + BLIND_MAX >= self._number
        end = self._situation.local_map.slot if reaches_end else NOWHERE
        self._spread(WalkOver(push, end, tuple(message_of(each) for each in self._stretches.found.values())))

    def _announce(self, at: Waypoint) -> None:
        local_map = self._situation.local_map
        heading = local_map.heading or 0.0
        before, self._latest = self._latest, at
        self._number += 1
        said_dead = self._situation.said_dead
        at_body = any(each not in local_map.states or each in said_dead for each in at.robots)
        left = before is not None and leaves_wall(
            self._hand, before.touched, at.touched, at.x_m - before.x_m, at.y_m - before.y_m
        )
        place = turned_vector((at.x_m, at.y_m), heading)
        walls = tuple(wrapped(each + heading) for each in at.touched)
        seen = tuple(each.node for each in at.sightings)
        self._stretches.take(self._number, place, walls, at.robots, seen, at_body, left)
        stretch = self._stretches.latest
        point = PassedPoint(
            self._push or 0,
            self._number,
            self._hand,
            self._stretches.touch_since,
            tuple((each.node, wrapped(each.bearing_rad + heading + math.pi)) for each in at.sightings),
            walls,
            at.robots,
            place,
            None if stretch is None else message_of(stretch),
            self._sightlines.take(self._number, seen),
        )
        self._outbox.append(Outgoing(None, point))

    # --- walks of others ----------------------------------------------------------------------------------------------

    def receive(self, sender: int, message: WalkMessage, tick: int) -> None:
        """Take in a point of another robot's walk, an answer to this robot's walk, or the end of a walk."""
        match message:
            case PassedPoint():
                self._hear(sender, message, tick)
            case ArcClosed(push):
                self._closed = self._closed or push == self._push
            case DeadInSight(push, robots) if push == self._push:
                self._situation.said_dead.update(dict.fromkeys(robots))
            case NeighbourProved():
                self._accept(message, tick)
            case WalkOver(push) if push not in self._over:
                self._spread(message)
                self._on_over(push)
                self._ended.append(message)
                if not self._kept:
                    self._end_walks(tick)
            case _:
                pass

    @property
    def _proves(self) -> bool:
        local_map = self._situation.local_map
        placed = local_map.slot != NOWHERE and not (local_map.moving or local_map.redundant or local_map.displaced)
        return placed and local_map.heading is not None

    def _hear(self, sender: int, passed: PassedPoint, tick: int) -> None:
        """Take a point into the proof of this robot's slot, or keep it until the proof has a view of the slot."""
        local_map = self._situation.local_map
        self._warn(sender, passed)
        if not self._proves:
            return
        if local_map.proof.ready:
            self._pass(sender, passed, self._slots(), tick)
        else:
            self._kept.keep(sender, passed, local_map)

    def _slots(self) -> dict[int, int]:
        """Return the slots of this robot and of the robots that it sees and that see it."""
        local_map = self._situation.local_map
        standing = {node: state.slot for node, state in local_map.mutual().items() if not state.displaced}
        return standing | {local_map.node: local_map.slot}

    def _warn(self, sender: int, passed: PassedPoint) -> None:
        """Tell the walking robot once which robots that it sees or touches are dead: it may not have asked them."""
        named = (*(node for node, _ in passed.seen), *passed.robots)
        dead = [node for node in self._situation.dead if node in named and (passed.push, node) not in self._warned]
        if dead:
            self._warned.update(dict.fromkeys((passed.push, node) for node in dead))
            self._outbox.append(Outgoing(sender, DeadInSight(passed.push, tuple(dead))))

    def _take_kept(self, tick: int) -> None:
        """Take the points into the proof that were received before it had a view of the slot."""
        local_map = self._situation.local_map
        if self._proves and not local_map.proof.ready:
            local_map.update_proof()
        for sender, passed, slots in self._kept.take(local_map):
            if self._proves and local_map.node in slots:
                self._pass(sender, passed, slots, tick)

    def _pass(self, sender: int, passed: PassedPoint, slots: Mapping[int, int], tick: int) -> None:
        """Take a point into the proof of this robot's slot; `slots` has the slots of the robots that count."""
        situation, local_map, slot = self._situation, self._situation.local_map, self._situation.local_map.slot
        # A robot that was dead before the walk is no witness, although the walking robot sees its body.
        gone = {*situation.dead, *situation.told_dead}
        point = WalkPoint(
            {slots[node]: direction for node, direction in passed.seen if node in slots},
            passed.walls,
            tuple(slots.get(node, NOWHERE) for node in passed.robots),
            unplaced=tuple(mark_of(node) for node, _ in passed.seen if node not in slots and node not in gone),
            at=passed.at,
        )
        stretch = None if passed.stretch is None else stretch_of(passed.stretch, slots)
        if stretch is not None:
            local_map.proof.extend(passed.push, stretch)
        if slot not in point.seen:
            local_map.proof.lose_sight(passed.push, passed.number, self._occupied(node for node, _ in passed.seen))
        if slot not in point.seen or point.is_blind:
            return
        received = self._received.get(sender)
        if received is not None and received[:2] != (passed.push, slot):
            received = None
        hidden = self._hidden(passed, 0 if received is None else received.seen.number)
        now = SeenPoint(passed.number, point)
        step = WallStep(None, point, passed.hand, (), passed.number)
        if received is not None:
            witnesses = _witnesses(passed, received.seen.number, hidden, slots)
            before = point_before(slot, received.seen, now, passed.touch_since, bool(witnesses))
            if before is not None and witnesses is not None:
                step = WallStep(before, point, passed.hand, witnesses, passed.number)
        self._received[sender] = _Received(passed.push, slot, now, step)
        occupied = [self._occupied(nodes) for nodes in hidden]
        if local_map.proof.pass_step(passed.push, None if received is None else received.step, step, stretch, occupied):
            self._replan_at = tick + PASSED_TICKS
            self._outbox.append(Outgoing(sender, ArcClosed(passed.push)))
        nodes = {each: node for node, each in self._slots().items()}  # not all of them saw this point
        for each, arc in dict.fromkeys(local_map.proof.for_neighbours):
            if each in nodes:  # else its robot has left since the step before
                self._outbox.append(Outgoing(nodes[each], NeighbourProved(each, arc)))
        local_map.proof.for_neighbours.clear()

    def _accept(self, message: NeighbourProved, tick: int) -> None:
        """Take an arc that a neighbour has proved into the proof of this robot's slot."""
        local_map = self._situation.local_map
        if (
            self._proves
            and local_map.proof.ready
            and local_map.slot == message.slot
            and local_map.proof.accept(proved_arc(message))
        ):
            self._replan_at = tick + PASSED_TICKS

    def _hidden(self, passed: PassedPoint, last: int) -> tuple[tuple[int, ...], ...]:
        """Return the robots that saw the points of a walk between the point `last` and this one, if this robot did not."""
        hidden = next((each for each in passed.hidden if each[0] == self._situation.node), None)
        return () if hidden is None or hidden[1] < last else hidden[2]

    def _occupied(self, nodes: Iterable[int]) -> tuple[int, ...]:
        """Return the slots of robots that stand, as far as this robot knows. A dead robot may be in sight that nobody knows."""
        known = self._situation.local_map.states
        states = [known[node] for node in nodes if node in known]
        return tuple(each.slot for each in states if each.is_at_slot)

    def _end_walks(self, tick: int) -> None:
        """Take into the proof how far walls were followed by walks that have ended."""
        proof, slots = self._situation.local_map.proof, self._slots()
        for over in self._ended:
            for number, each in enumerate(over.stretches, 1):
                stretch = stretch_of(each, slots)
                if number == len(over.stretches) and over.end != NOWHERE:
                    stretch = stretch.tied_at_end(over.end)
                if proof.extend(over.push, stretch):
                    self._replan_at = tick + PASSED_TICKS
            proof.end_walk(over.push, max((each.last_number for each in over.stretches), default=0), over.end)
        self._ended.clear()

    def _spread(self, over: WalkOver) -> None:
        self._over[over.push] = None
        self._outbox.append(Outgoing(None, over))

    # --- every tick ---------------------------------------------------------------------------------------------------

    def restarted(self, node: int, tick: int) -> None:
        """Forget the points of a former incarnation."""
        self._received.pop(node, None)
        self._kept.forget(node)

    def is_idle(self, tick: int) -> bool:
        """Return whether no points are kept."""
        return not self._kept

    def poll(self, tick: int) -> None:
        """Take in the points that were kept, and make plans again once a walk has passed."""
        if self._kept and self._situation.settled:
            self._take_kept(tick)
            self._end_walks(tick)
        if self._replan_at is not None and tick >= self._replan_at:
            self._replan_at = None
            self._situation.local_map.replan()

    def outgoing(self) -> list[Outgoing]:
        """Return the messages to send now."""
        sent, self._outbox = self._outbox, []
        return sent

    def next_wake(self) -> int | None:
        """Return the tick at which plans are made again."""
        return self._replan_at


def _witnesses(
    passed: PassedPoint, last: int, hidden: Collection[Iterable[int]], slots: Mapping[int, int]
) -> tuple[int, ...] | None:
    """Return slots that saw all points since the one with the number `last`, where the walk was `hidden`; or None.

    Points whose messages were lost were seen, unless the walking robot says otherwise.
    """
    if not hidden:
        return () if passed.number - last <= RESENT_POINTS else None
    found: dict[int, None] = {}
    for nodes in hidden:
        known = [slots[node] for node in nodes if node in slots]
        if not known:
            return None
        if not any(each in found for each in known):
            found[known[0]] = None
    return tuple(sorted(found))
