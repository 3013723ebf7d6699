"""The robot of landmark-based exploration (Ramaithitima and Bhattacharya 2018), with a coordinator or without.

The robot senses bearings to the landmarks that it sees, contact and its compass heading, and has a radio. At every tick it
adds its observation to its map, and new entries to its log. It sends the log to the coordinator, or by gossip to the
other robots. A task is a frontier and the path there. The coordinator assigns tasks, or the robot chooses and claims
them itself, as `services` says.
"""

from typing import ClassVar, Final

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.boundary_trace import inconsistent
from zwerm.agents.landmark_exploration.mapping.cost_utility import Offer, Policy, cost_utility, nearest_frontier
from zwerm.agents.landmark_exploration.mapping.frontier_status import (
    ABANDONED,
    BOUNDARY,
    CLEAR,
    REOPENED,
    TIMED_OUT,
    pair_of,
)
from zwerm.agents.landmark_exploration.mapping.landmark_map import LandmarkMap
from zwerm.agents.landmark_exploration.mapping.map_reports import MapReport, columns, write_report
from zwerm.agents.landmark_exploration.motion import Drive, Outcome, explore, roam, travel, wander
from zwerm.agents.landmark_exploration.parameters import ExplorerParameters
from zwerm.agents.landmark_exploration.sharing import landmark_messages as messages
from zwerm.agents.landmark_exploration.sharing.exploration_tasks import ExplorationTask, TaskIntake, landmark_bytes
from zwerm.agents.landmark_exploration.sharing.landmark_messages import Message, Register, TaskPart, TaskReport, Vector
from zwerm.agents.landmark_exploration.sharing.log_entries import failure_entry, observation_entries, status_entries
from zwerm.agents.landmark_exploration.sharing.log_gossip import AddressedMessage, Gossip
from zwerm.agents.landmark_exploration.sharing.registers import Registers
from zwerm.agents.landmark_exploration.sharing.replica import Replica, Stretch, origin_of
from zwerm.agents.landmark_exploration.sharing.turn_taking import TurnTaking
from zwerm.agents.landmark_exploration.sharing.upload import Upload
from zwerm.agents.landmark_exploration.view import ExplorerView, Slide
from zwerm.agents.landmark_exploration.wayfinding import MEETING_TICKS, VISIT_TICKS, meet, visit
from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ControllerError
from zwerm.wire.messages import Command, Observation, Packet, Transmission

# Ticks between reports of a free robot, and of a busy robot. Reports show the coordinator that the robot works.
FREE_REPORT_TICKS: Final = 5
BUSY_REPORT_TICKS: Final = 50
# Up to this many free frontiers a robot considers them at once when another one opens. With more, some are near.
FEW_FREE: Final = 48
# Without `look_idle` a robot adds observations to its map in its first LOOK_TICKS, and then only while it explores, or
# if no path led to any free frontier for CUT_OFF_TICKS.
LOOK_TICKS: Final = 5
CUT_OFF_TICKS: Final = 200
# Ticks for which a robot does not choose a frontier that it did not reach.
AVOID_TICKS: Final = 300
# An idle robot goes to the meeting place if it received no register of some robot for this time: its map may be old.
FRESH_TICKS: Final = 100
# A robot also goes there before its next task if half of the others were silent for this time: it might explore what
# others have explored. The time doubles after each visit without a message.
ISOLATED_TICKS: Final = 250
# Ticks between two snapshots for the observers of the run.
TELEMETRY_TICKS: Final = 25

ROBOTS: Final = "robots"
UPLINK: Final = "uplink"


class Explorer(Controller):
    """Explores until no frontier is left."""

    sensors: ClassVar[tuple[str, ...]] = ("landmarks", "compass_rad", "touch")
    Parameters: ClassVar[type[ExplorerParameters]] = ExplorerParameters

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        rules: ExplorerParameters = self.parameters
        assert setup.body is not None
        self._speed_m_s = setup.body.max_speed_m_s
        self._bytes_max = rules.message_bytes_max
        self.view = ExplorerView()
        self.map = LandmarkMap(rules.presence_only)
        self.replica = Replica()
        self._origin = origin_of(setup.node, setup.incarnation)
        self._slide = Slide(self.random)
        self._claims = setup.services.get("assignment", "coordinator") == "claims"
        if rules.presence_only and not self._claims:
            raise ControllerError("presence_only: robots without bearings need services.assignment=claims")
        gossips = setup.services.get("map", "coordinator") == "gossip"
        self._channel = ROBOTS if gossips else UPLINK
        self.registers = Registers(rules.lease_ticks, rules.dead_ticks, rules.robots_expected)
        self._gossip: Gossip | None = None
        if (gossips or self._claims) and self._channel in setup.channels:
            self._gossip = Gossip(setup.node, self.replica, self.registers, self._learn, rules.message_bytes_max)
        self._carries = (gossips and self._claims) or rules.strategy == "random-walk" or rules.presence_only
        self._upload: Upload | None = None
        if not self._claims and UPLINK in setup.channels:
            self._upload = Upload(self.replica, self._origin, rules.message_bytes_max)
        self._intake = TaskIntake(setup.incarnation % 256)
        self._task: ExplorationTask | None = None
        self._halted = False
        self._reached = True
        self._report_at = 0
        self._stamp = 0
        self._claim = 0
        self._frozen = False
        self._quiet_since = 0
        self._turns = TurnTaking()
        self._news_at = 0
        self._no_way_since: int | None = None
        self._cut_off = False
        self._isolated_ticks = ISOLATED_TICKS
        self._avoid_until: dict[int, int] = {}
        self._outbox: list[Transmission] = []
        self._seen: list[BearingSnapshot] = []
        self._reported_status = (False, False)
        self._drive: Drive = self._run_tasks()
        self.done = False

    def step(self, observation: Observation) -> Command:
        """Update the view, process packets, choose a motion, and send messages."""
        self.view.take(observation)
        for packet in observation.inbox:
            self._receive(packet)
        if self._looks():
            self._observe()
        direction = self._slide.along(next(self._drive), self.view)
        self._update_end()
        self._send_messages()
        outbox, self._outbox = tuple(self._outbox), []
        return Command(
            drive=self.view.drive(direction, self._speed_m_s), outbox=outbox, done=self.done, snapshot=self._snapshot()
        )

    def _looks(self) -> bool:
        """Return whether the robot adds its observations to the map."""
        if self._frozen or self._halted:
            return False
        if self.parameters.strategy == "random-walk" or self.parameters.presence_only:
            return True
        return self.parameters.look_idle or self._task is not None or self._cut_off or self.view.tick <= LOOK_TICKS

    # --- the map ----------------------------------------------------------------------------------------------------

    def _observe(self) -> None:
        """Add the observation to the map, and to the log if it changed the map."""
        snapshot = self.view.snapshot
        number = self.replica.vector.get(self._origin, 0)
        parts = (len(snapshot.landmarks) - 1) // 13  # the entry that completes an observation gives it its rank
        if len(snapshot.landmarks) and self.map.observe(snapshot, (number + max(parts, 0), self._origin)):
            self._news_at = self.view.tick
            self._write(observation_entries(snapshot))
            if self._claims:
                self._seen.append(snapshot)

    def _raise(self, keys: list[int], status: int) -> None:
        """Raise frontiers to a status, and add this to the log."""
        if self.map.raise_all(keys, status):
            self._write(status_entries(keys, status))

    def _write(self, entries: list[bytes]) -> None:
        stretch = self.replica.append(self._origin, entries)
        if self._gossip is not None:
            self._gossip.announce(stretch)

    def _learn(self, stretch: Stretch, held: int) -> None:
        """Add entries of other robots to the map. A frozen robot resumes if a frontier is open then."""
        self.map.read(stretch, held)
        if self._frozen and (self.map.frontiers.open or self.parameters.presence_only):
            self._frozen = False
        if self.parameters.presence_only:
            self._quiet_since = self.view.tick

    # --- tasks ------------------------------------------------------------------------------------------------------

    def _run_tasks(self) -> Drive:
        """Carry out one task after the other, with a random walk between them."""
        idle = wander(self.view, self.random, self.parameters.turn_sd_rad)
        if self.parameters.presence_only:
            idle = roam(self.view, self.random, lambda: self._news_at == self.view.tick)

        def to_meeting() -> Drive:
            return meet(self.view, self.map, self.random, lambda: next(idle), self._meeting_ticks)

        meeting = to_meeting()
        meets = self._carries and not self.parameters.presence_only
        while True:
            if meets and self._task is None and self._is_isolated():
                self._isolated_ticks *= 2
                yield from visit(self.view, self.map, self.random, lambda: VISIT_TICKS)
            if self._task is None:
                self._choose()
            if self._task is None or self._task.key is None:
                # Idle robots walk to see more, and without a coordinator to exchange the map. Else they wait for a task.
                looks = self.parameters.look_idle and not self._frozen
                if self._halted or not (looks or self._carries or self._cut_off):
                    yield None
                else:
                    yield next(meeting if meets and self._waits_for_news() else idle)
                continue
            task = self._task
            outcome = yield from self._carry_out(task)
            if task is self._task:
                self._conclude(task, outcome)
                self._task = None
            meeting = to_meeting()  # the robot is far from its former waiting place

    def _meeting_ticks(self) -> int:
        """Return the time at the meeting place: short if a random walk may find a path to an open frontier."""
        return MEETING_TICKS if self._no_way_since is None else VISIT_TICKS

    def _is_isolated(self) -> bool:
        """Return whether half of the others have been silent for longer than the present limit."""
        since, tick = self.registers.half_silent_since(self.setup.node), self.view.tick
        if since is not None and tick - since < ISOLATED_TICKS:
            self._isolated_ticks = ISOLATED_TICKS
        return since is not None and tick - since >= self._isolated_ticks

    def _waits_for_news(self) -> bool:
        """Return whether other robots may have entries that this idle robot lacks."""
        return self._frozen or not self.registers.is_fresh(self.setup.node, self.view.tick, FRESH_TICKS)

    def _carry_out(self, task: ExplorationTask) -> Drive:
        """Navigate to the frontier, then explore it; end early if another task arrives."""
        assert task.key is not None
        (a, b), rules = pair_of(task.key), self.parameters

        def superseded() -> bool:
            return self._task is not task

        def is_clear() -> bool:
            return self.map.frontiers.status(a, b) == CLEAR or superseded()

        def is_there() -> bool:
            return (a in self.view.bearing and b in self.view.bearing) or is_clear()

        outcome = yield from travel(self.view, task.path, self.random, is_there)
        if outcome == "unreached" or superseded():
            return "unreached"
        return (yield from explore(self.view, a, b, self.random, is_clear, rules.cross_ticks, rules.search_ticks))

    def _conclude(self, task: ExplorationTask, outcome: Outcome) -> None:
        """Record how a task ended."""
        assert task.key is not None
        self._reached = outcome != "unreached"
        self._claim = 0
        self._report_at = 0
        if self._gossip is not None:
            self._gossip.beacon_soon()
        if outcome == "boundary":
            self._raise([task.key], BOUNDARY)
        elif outcome == "timed-out":
            self._raise([task.key], task.status)
        elif outcome == "unreached" and self._claims:
            self.map.fail(task.key)
            self._write([failure_entry(task.key)])
            self._avoid_until[task.key] = self.view.tick + AVOID_TICKS

    def _choose(self) -> None:
        """Choose a frontier and claim it, if robots assign themselves."""
        rules, tick = self.parameters, self.view.tick
        if not self._claims or self._frozen or rules.strategy == "random-walk":
            return
        frontiers = self.map.frontiers
        alone = rules.strategy == "nearest-frontier"
        avoided = dict.fromkeys(key for key, until in self._avoid_until.items() if tick < until)
        offer = Offer(frontiers, () if alone else self.registers.claims(self.setup.node, tick), avoided)
        if not self._turns.considers(offer.free_keys(FEW_FREE), tick):
            return
        policy: Policy = nearest_frontier if alone else cost_utility(rules.beta)
        choice = policy(self.map.complex, self.view.snapshot.landmarks, offer)
        if choice is None:
            if offer.is_empty():
                self._no_way_since = None
            elif self._no_way_since is None:
                self._no_way_since = tick
            has_no_way = self._no_way_since is not None and tick - self._no_way_since >= CUT_OFF_TICKS
            self._cut_off = has_no_way or not (frontiers.open or frontiers.has_area)
            self._turns.found_none(tick)
            return
        self._no_way_since, self._cut_off = None, False
        if not alone and not self._turns.claims(len(choice.path), tick):
            return
        status = ABANDONED if frontiers.statuses[choice.key] == REOPENED else TIMED_OUT
        self._task = ExplorationTask(choice.key, tuple(map(self.map.complex.snapshot_of, choice.path)), status)
        self._claim = choice.key + 1
        if self._gossip is not None:
            self._gossip.beacon_soon()

    def _update_end(self) -> None:
        """Freeze after a time without an open frontier, and conclude when all robots are frozen."""
        tick = self.view.tick
        if not self._claims or self._gossip is None:
            return
        rules = self.parameters
        if rules.presence_only:
            has_news = self._news_at == tick
        else:
            # A map without an area is not explored: there are too few landmarks, or all are on one line.
            has_news = bool(self.map.frontiers.open) or not self.map.frontiers.has_area
        if self._task is not None or has_news:
            self._quiet_since = tick
        quiet_ticks = rules.stagnation_ticks if rules.presence_only else rules.freeze_ticks
        if not self._frozen and tick - self._quiet_since >= quiet_ticks:
            again = inconsistent(self.map.frontiers)
            if again:
                self._raise(again, REOPENED)
                self._quiet_since = tick
            elif self.parameters.strategy != "random-walk":
                self._frozen = True
                self._gossip.beacon_soon()
        self.done = self._frozen and self.registers.concluded(self.replica.digest, tick)

    # --- the radio --------------------------------------------------------------------------------------------------

    def _receive(self, packet: Packet) -> None:
        message = messages.read(packet.payload)
        if message is None or packet.sender is None:
            return
        if packet.channel == UPLINK and isinstance(message, TaskPart):
            self._accept_task(message)
        elif packet.channel == UPLINK and self._upload is not None and isinstance(message, Vector):
            self._upload.acknowledge(message)
        elif packet.channel == self._channel and self._gossip is not None:
            self._gossip.receive(packet.sender, message, self.view.tick)

    def _accept_task(self, part: TaskPart) -> None:
        task = None if self._claims else self._intake.accept(part)
        if task is None:
            return
        self._report_at = 0
        self._halted = task.key is None and not task.walk
        self._cut_off = task.walk
        self._reached = True
        self._task = None if task.key is None else task

    def _send_messages(self) -> None:
        tick = self.view.tick
        if self._gossip is not None:
            self._send(self._channel, self._gossip.tick(tick, self._register))
        if self._upload is not None:
            self._send(UPLINK, [AddressedMessage(None, each) for each in self._upload.tick(tick)])
            if tick >= self._report_at:
                free = self._task is None
                self._report_at = tick + (FREE_REPORT_TICKS if free else BUSY_REPORT_TICKS)
                self._send(UPLINK, [AddressedMessage(None, self._report(free))])

    def _report(self, free: bool) -> Message:
        incarnation, task_number = self._intake.newest
        landmarks = landmark_bytes(self.view.snapshot.landmarks)
        entries = self.replica.vector.get(self._origin, 0)
        return TaskReport(
            self.setup.incarnation % 256, incarnation, task_number, free, self._reached, entries, landmarks
        )

    def _register(self) -> Register:
        self._stamp += 1
        frozen = self.replica.digest + 1 if self._frozen else 0
        return Register(self.setup.node, self.setup.incarnation, self._stamp, self._claim, frozen)

    def _send(self, channel: str, outgoing: list[AddressedMessage]) -> None:
        self._outbox += [Transmission(channel, messages.write(message), to) for to, message in outgoing]

    # --- telemetry --------------------------------------------------------------------------------------------------

    def _snapshot(self) -> bytes:
        """Return the snapshot for the observers of the run: new observations of this robot, open frontiers and its claim."""
        status = (bool(self.map.frontiers.open), self.done)
        if not self._claims or (self.view.tick % TELEMETRY_TICKS and status == self._reported_status):
            return b""
        self._reported_status = status
        seen, self._seen = self._seen, []
        claim = () if not self._claim else ((self.setup.node, *pair_of(self._claim - 1)),)
        count = len(self.map.frontiers.open)
        return write_report(MapReport(*columns(seen), open=count, done=self.done, of_robot=True, assigned=claim))
