"""Walks without a coordinator: the walking robot announces its way, and the robots that it passes prove their slots.

Each robot that a point of the walk names takes the point into the proof of its own slot, and answers if that closed
something. A robot whose view is not complete yet keeps the points until it is. The end of a walk is flooded, because the
walking robot is out of range of its push by then. A lost message leaves an arc open, which is tried again.
"""

import math
from collections.abc import Callable, Collection, Mapping
from typing import ClassVar, Final, NamedTuple, Protocol

from zwerm.agents.sensor_coverage.frontier.directions import wrapped
from zwerm.agents.sensor_coverage.frontier.slot_proof import SlotProof, WallStep
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    SeenPoint,
    TouchCounter,
    WalkPoint,
    drives_away,
    mark_of,
    point_before,
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

# A robot makes plans again this many ticks after the latest point that closed something: the walk has passed.
PASSED_TICKS: Final = 10
# Points for which it is remembered who saw them, and points in which it is repeated who sees the walking robot again. Who
# misses more points than the latter takes them as unseen.
REMEMBERED_POINTS: Final = 60
RESENT_POINTS: Final = 10


class ProvedSlot(Neighbourhood, Protocol):
    """What a robot knows of its slot, its neighbours, and the proof of coverage there."""

    moving: bool
    redundant: bool
    heading: float | None
    proof: SlotProof

    def update_proof(self) -> None:
        """Take the present view into the proof."""

    def replan(self) -> None:
        """Make plans again."""


class StepReporter(Protocol):
    """A walk that reports each of its points to `on_step`."""

    on_step: Callable[[Waypoint], None]


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


class _Hidden(NamedTuple):
    """A robot sees the walking robot again at the point `number`, after `last`; and the robots that saw the points between."""

    number: int
    last: int
    between: tuple[tuple[int, ...], ...]


class Sightlines:
    """Which robots saw the points of this robot's walk, and which see it again after they had lost it."""

    def __init__(self) -> None:
        self._seen: dict[int, tuple[int, ...]] = {}  # the latest points
        self._last: dict[int, int] = {}
        self._hidden: dict[int, _Hidden] = {}

    def take(self, number: int, seen: tuple[int, ...]) -> tuple[tuple[int, int, tuple[tuple[int, ...], ...]], ...]:
        """Take in the robots that see a point, and return those that see the walking robot again; see `PassedPoint`."""
        for node in seen:
            last = self._last.get(node)
            if last is not None and last < number - 1:
                # Points that are forgotten were seen by nobody, as far as is known.
                between = [self._seen.get(each, ()) for each in range(last + 1, number)]
                self._hidden[node] = _Hidden(number, last, tuple(dict.fromkeys(between)))
            self._last[node] = number
        self._seen[number] = seen
        self._seen.pop(number - REMEMBERED_POINTS, None)
        self._hidden = {node: each for node, each in self._hidden.items() if each.number > number - RESENT_POINTS}
        return tuple((node, each.last, each.between) for node, each in self._hidden.items() if node in seen)


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
        self._touch, self._sightlines = TouchCounter(), Sightlines()
        self._closed = False
        self._received: dict[int, _Received] = {}
        self._kept = KeptPoints()
        self._replan_at: int | None = None
        self._over: dict[int, None] = {}
        self._latest: Waypoint | None = None
        self._warned: dict[tuple[int, int], None] = {}  # (push, dead robot) that the walking robot was told

    # --- this robot's own walk ----------------------------------------------------------------------------------------

    def begin(self, push: int, hand: int) -> None:
        """Announce the points of the walk that begins now."""
        if push != self._push:
            self._push, self._hand, self._number = push, hand, 0
            self._touch, self._sightlines = TouchCounter(), Sightlines()
            self._latest = None
            self._situation.said_dead.clear()
        self._closed = False
        self._situation.wall_walk.on_step = self._announce

    def has_closed(self) -> bool:
        """Return whether a robot answered since the latest `begin` that an open arc became smaller."""
        return self._closed

    def end(self, push: int) -> None:
        """Announce that the walk is over."""
        self._push = None
        self._situation.wall_walk.on_step = lambda _: None
        self._spread(push)

    def _announce(self, at: Waypoint) -> None:
        local_map = self._situation.local_map
        heading = local_map.heading or 0.0
        before, self._latest = self._latest, at
        self._number += 1
        said_dead = self._situation.said_dead
        at_body = any(each not in local_map.states or each in said_dead for each in at.robots)
        left = before is not None and drives_away(
            self._hand, before.touched, at.touched, at.x_m - before.x_m, at.y_m - before.y_m
        )
        self._touch.take(self._number, at.touched, at_body, left)
        point = PassedPoint(
            self._push or 0,
            self._number,
            self._hand,
            self._touch.since,
            tuple((each.node, wrapped(each.bearing_rad + heading + math.pi)) for each in at.sightings),
            tuple(wrapped(each + heading) for each in at.touched),
            at.robots,
            self._sightlines.take(self._number, tuple(each.node for each in at.sightings)),
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
                self._spread(push)
                self._on_over(push)
            case _:
                pass

    @property
    def _proves(self) -> bool:
        local_map = self._situation.local_map
        placed = local_map.slot != NOWHERE and not (local_map.moving or local_map.redundant)
        return placed and local_map.heading is not None

    def _hear(self, sender: int, passed: PassedPoint, tick: int) -> None:
        """Take a point into the proof of this robot's slot, or keep it until the proof has a view of the slot."""
        local_map = self._situation.local_map
        self._warn(sender, passed)
        if not self._proves:
            return
        if local_map.proof.ready:
            slots = {node: state.slot for node, state in local_map.mutual().items()} | {local_map.node: local_map.slot}
            self._pass(sender, passed, slots, tick)
        else:
            self._kept.keep(sender, passed, local_map)

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
        local_map, slot = self._situation.local_map, self._situation.local_map.slot
        point = WalkPoint(
            {slots[node]: direction for node, direction in passed.seen if node in slots},
            passed.walls,
            tuple(slots.get(node, NOWHERE) for node in passed.robots),
            unplaced=tuple(mark_of(node) for node, _ in passed.seen if node not in slots),
        )
        if slot not in point.seen or point.is_blind:
            return
        received = self._received.get(sender)
        if received is not None and received[:2] != (passed.push, slot):
            received = None
        now = SeenPoint(passed.number, point)
        step = WallStep(None, point, passed.hand)
        if received is not None:
            witnesses = self._witnesses(passed, received.seen.number, slots)
            before = point_before(slot, received.seen, now, passed.touch_since, bool(witnesses))
            if before is not None and witnesses is not None:
                step = WallStep(before, point, passed.hand, witnesses)
        self._received[sender] = _Received(passed.push, slot, now, step)
        if local_map.proof.pass_step(slot, None if received is None else received.step, step):
            self._replan_at = tick + PASSED_TICKS
            self._outbox.append(Outgoing(sender, ArcClosed(passed.push)))
        nodes = {each: node for node, each in slots.items()}
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
            and local_map.proof.accept(message.arc)
        ):
            self._replan_at = tick + PASSED_TICKS

    def _witnesses(self, passed: PassedPoint, last: int, slots: Mapping[int, int]) -> tuple[int, ...] | None:
        """Return slots that saw all points since the one with the number `last`, as far as this robot did not; or None.

        Points whose messages were lost were seen, unless the walking robot says otherwise.
        """
        hidden = next((each for each in passed.hidden if each[0] == self._situation.node), None)
        if hidden is None or hidden[1] < last:
            return () if passed.number - last <= RESENT_POINTS else None
        found: dict[int, None] = {}
        for witnesses in hidden[2]:
            known = [slots[node] for node in witnesses if node in slots]
            if not known:
                return None
            if not any(each in found for each in known):
                found[known[0]] = None
        return tuple(sorted(found))

    def _spread(self, push: int) -> None:
        self._over[push] = None
        self._outbox.append(Outgoing(None, WalkOver(push)))

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
