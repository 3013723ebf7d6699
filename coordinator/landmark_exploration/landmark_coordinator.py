"""The coordinator of landmark-based exploration: the map of all robots, and the assignment of frontiers to robots.

Algorithm 1 of Ramaithitima and Bhattacharya 2018. The coordinator receives the logs of the robots, and the landmarks that
each robot sees. If robots assign themselves, it is only a hub that forwards their gossip.

Exploration ends when no frontier is open, every robot is halted, and the coordinator has all entries of their logs. A
halted robot adds nothing to its log. A robot that is silent for `dead_ticks` is presumed dead: its frontier is free again.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import msgspec
from msgspec import Struct

from zwerm.agents.landmark_exploration.mapping.boundary_trace import inconsistent
from zwerm.agents.landmark_exploration.mapping.cost_utility import (
    Choice,
    Costs,
    Offer,
    frontier_costs,
    min_pos,
    nearest_frontier,
)
from zwerm.agents.landmark_exploration.mapping.frontier_status import ABANDONED, REOPENED, TIMED_OUT, pair_of
from zwerm.agents.landmark_exploration.mapping.landmark_map import FAILURES_MAX, LandmarkMap
from zwerm.agents.landmark_exploration.mapping.map_reports import MapReport, columns, write_report
from zwerm.agents.landmark_exploration.parameters import CentralStrategy, MessageBytes, NonNegative, Ticks
from zwerm.agents.landmark_exploration.sharing import landmark_messages as messages
from zwerm.agents.landmark_exploration.sharing.exploration_tasks import ExplorationTask, cut, landmarks_in, write_task
from zwerm.agents.landmark_exploration.sharing.landmark_messages import LARGE_BYTES, Entries, TaskReport, Vector
from zwerm.agents.landmark_exploration.sharing.log_gossip import AddressedMessage, Gossip
from zwerm.agents.landmark_exploration.sharing.registers import Registers
from zwerm.agents.landmark_exploration.sharing.replica import Replica, Stretch, origin_of
from zwerm.coordinator.landmark_exploration.greedy_assignment import GUIDED_MAX, GreedyAssignment
from zwerm.wire.messages import Command, Observation, Transmission

# Ticks after which a robot without a frontier is considered again: the first time, and at most.
RETRY_TICKS: Final = 10
RETRY_TICKS_MAX: Final = 80
# Largest age [ticks] of the costs by which min-pos ranks the other robots.
RANK_TICKS: Final = 20
# Ticks between two transmissions of the same task.
RESEND_TICKS: Final = 4
# Ticks between two snapshots of the map for the observers of the run.
TELEMETRY_TICKS: Final = 25
# Frontiers and simplices in one such snapshot, at most.
FRONTIERS_REPORTED_MAX: Final = 1_500
SIMPLICES_REPORTED_MAX: Final = 400
# Bytes of messages that the coordinator sends in one tick, at most: its command must fit into one message to the world.
OUTBOX_BYTES_MAX: Final = 20_000


class CoordinatorParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """`beta` weighs the cost against the utility; `strategy` chooses frontiers; a robot silent for `dead_ticks` is dead.

    With `walk_if_cut_off` a robot from which no path leads to a free frontier does a random walk, and looks. Without it such a
    robot does what robots without a frontier do: it waits if its `look_idle` is false.
    """

    beta: NonNegative = 10.0
    strategy: CentralStrategy = "cost-utility"
    walk_if_cut_off: bool = True
    dead_ticks: Ticks = 600
    message_bytes_max: MessageBytes = LARGE_BYTES


class LandmarkCoordinatorSetup(Protocol):
    """The setup of the coordinator."""

    @property
    def node(self) -> int:
        """Its id: those of robots are below it."""

    @property
    def parameters(self) -> dict[str, Any]:
        """Parameters of the scenario."""

    @property
    def services(self) -> dict[str, str]:
        """Provider of each service."""

    @property
    def incarnation(self) -> int:
        """Number of its starts."""


@dataclass
class _Robot:
    """The known state of one robot. `task_number` is the number of its last task, `task`; None before the first."""

    incarnation: int = -1
    received_at: int = 0
    task_number: int = 0
    task: ExplorationTask | None = None
    sent_at: int = -1_000
    free: bool = False
    landmarks: tuple[int, ...] = ()
    entries: int = 0
    consider_at: int = 0
    retry_ticks: int = RETRY_TICKS


class LandmarkCoordinator:
    """Assigns frontiers to free robots until none is left."""

    Parameters = CoordinatorParameters

    def __init__(self, setup: LandmarkCoordinatorSetup) -> None:
        rules = msgspec.convert(setup.parameters, CoordinatorParameters)
        self.map = LandmarkMap()
        self.replica = Replica()
        self._rules = rules
        self._incarnation = setup.incarnation
        self._origin = origin_of(setup.node, setup.incarnation)
        self._tick = 0
        self._robots = {node: _Robot() for node in range(setup.node)}
        self._greedy = GreedyAssignment(self.map.complex, rules.beta)
        self._costs: dict[int, tuple[int, Costs]] = {}
        # Frontiers that were still free after the last assignment; None for more than GUIDED_MAX.
        self._left: list[int] | None = []
        self._failures: dict[int, int] = {}
        self._outbox: list[Transmission] = []
        self._acknowledge: dict[int, int] = {}
        self._reported_version = -1
        self._reported_vertices = 0
        self._done = False
        self._registers = Registers(rules.dead_ticks, rules.dead_ticks, setup.node)
        self._gossip: Gossip | None = None
        if setup.services.get("assignment", "coordinator") == "claims":
            self._gossip = Gossip(
                setup.node, self.replica, self._registers, self.map.read, rules.message_bytes_max, hub=True
            )

    def step(self, observation: Observation) -> Command:
        """Process packets, assign frontiers, and send messages."""
        self._tick = observation.tick
        for packet in observation.inbox:
            message = messages.read(packet.payload)
            if message is None or packet.sender is None:
                continue
            if self._gossip is not None:
                self._gossip.receive(packet.sender, message, self._tick)
            elif isinstance(message, Entries):
                self._receive_entries(packet.sender, message)
            elif isinstance(message, TaskReport) and packet.sender in self._robots:
                self._receive_report(packet.sender, message)
        if self._gossip is None:
            self._acknowledge_all()
            self._done = self._assign()
        else:
            self._send(self._gossip.tick(self._tick, None))
            self._done = not self.map.frontiers.open and self._registers.concluded(self.replica.digest, self._tick)
        return Command(outbox=self._due(), done=self._done, snapshot=self._snapshot())

    def _due(self) -> tuple[Transmission, ...]:
        """Return the messages that fit into one command; the rest waits for the next tick."""
        size = number = 0
        while number < len(self._outbox) and size < OUTBOX_BYTES_MAX:
            size += len(self._outbox[number].payload)
            number += 1
        due, self._outbox = tuple(self._outbox[:number]), self._outbox[number:]
        return due

    # --- messages of robots -----------------------------------------------------------------------------------------

    def _receive_entries(self, sender: int, message: Entries) -> None:
        stretch = Stretch(message.origin, message.first, message.entries)
        held = self.replica.vector.get(stretch.origin, 0)
        new = self.replica.extend(stretch)
        if new:
            self.map.read(Stretch(stretch.origin, held, tuple(new)), held)
        self._acknowledge[sender] = stretch.origin

    def _acknowledge_all(self) -> None:
        for node, origin in self._acknowledge.items():
            counts = (origin, self.replica.vector.get(origin, 0))
            self._send([AddressedMessage(node, Vector(origin, origin + 1, counts, ask=False))])
        self._acknowledge.clear()

    def _receive_report(self, node: int, report: TaskReport) -> None:
        robot = self._robots[node]
        if report.incarnation < robot.incarnation:
            return
        if report.incarnation > robot.incarnation:
            robot = self._robots[node] = _Robot(incarnation=report.incarnation)
        robot.received_at = self._tick
        robot.entries = report.entries
        if report.entries > self.replica.vector.get(self._origin_of(node), 0):
            self._acknowledge.setdefault(node, self._origin_of(node))
        try:
            robot.landmarks = landmarks_in(report.landmarks)
        except ValueError:
            return
        has_newest = report.coordinator_incarnation == self._incarnation and report.task_number == robot.task_number
        if robot.task is None:
            robot.free = report.free
            if report.coordinator_incarnation == self._incarnation:
                robot.task_number = max(robot.task_number, report.task_number)
        elif has_newest and report.free and robot.task.key is not None:
            if not report.reached:
                self._failed(robot.task)
            robot.task, robot.free = None, True
        elif has_newest:
            robot.free = robot.task.key is None
        elif self._tick - robot.sent_at >= RESEND_TICKS:
            self._send_task(node, robot)

    def _failed(self, task: ExplorationTask) -> None:
        """Record that a robot did not reach its frontier; FAILURES_MAX failures count as a time-out."""
        assert task.key is not None
        failures = self._failures[task.key] = self._failures.get(task.key, 0) + 1
        if failures >= FAILURES_MAX:
            self.map.raise_all([task.key], task.status)

    def _origin_of(self, node: int) -> int:
        return origin_of(node, self._robots[node].incarnation)

    # --- assignment: algorithm 1 --------------------------------------------------------------------------------------

    def _assign(self) -> bool:
        """Assign frontiers to all free robots; return whether exploration is complete.

        Lines 4 to 7 of algorithm 1. Of all pairs of a free robot and a frontier the best is assigned first.
        """
        living = [
            node for node, robot in self._robots.items() if self._tick - robot.received_at < self._rules.dead_ticks
        ]
        frontiers = self.map.frontiers
        taken: list[int] = []
        for node in living:
            robot = self._robots[node]
            if robot.task is None or robot.task.key is None:
                continue
            if robot.task.key not in frontiers.open and robot.landmarks and frontiers.open:
                robot.free = True  # another robot cleared it: the robot need not go there
                continue
            taken.append(robot.task.key)
        offer = Offer(frontiers, taken)
        if self._rules.strategy == "cost-utility" and self._has_new_frontier(offer):
            for robot in self._robots.values():
                robot.consider_at = self._tick
        free = [node for node in living if self._robots[node].free and self._robots[node].consider_at <= self._tick]
        if not frontiers.open:
            pass
        elif self._rules.strategy == "cost-utility":
            seen = {node: self._robots[node].landmarks for node in free}
            for node, choice in self._greedy.assigned(seen, offer):
                self._give(
                    node, choice, cut_off=choice is None and self._rules.walk_if_cut_off and not offer.is_empty()
                )
        else:
            for node in free:
                self._give(node, self._uncoordinated(node, living), cut_off=self._rules.walk_if_cut_off)
        self._left = offer.free_keys(GUIDED_MAX)
        return not frontiers.open and self._finish(living)

    def _has_new_frontier(self, offer: Offer) -> bool:
        """Return whether a frontier is free that was not left over by the last assignment: all free robots are considered.

        If only those whose time to wait is over were considered, a far robot would be sent, and the nearest one would wait.
        """
        if self._left is None:
            return False  # so many are free that only robots without a path to any of them wait
        keys = offer.free_keys(GUIDED_MAX)
        return keys is None or not set(keys) <= set(self._left)

    def _give(self, node: int, choice: Choice | None, cut_off: bool = False) -> None:
        """Assign a frontier to a robot; without a `choice`, consider the robot again later.

        A robot that is `cut_off`, because no path leads to a free frontier, does a random walk meanwhile.
        """
        if choice is None:
            robot = self._robots[node]
            robot.consider_at = self._tick + robot.retry_ticks
            robot.retry_ticks = min(2 * robot.retry_ticks, RETRY_TICKS_MAX)
            if cut_off and (robot.task is None or (robot.task.key is None and not robot.task.walk)):
                self._assign_task(node, ExplorationTask(None, walk=True), retry_ticks=robot.retry_ticks)
            return
        status = ABANDONED if self.map.frontiers.statuses[choice.key] == REOPENED else TIMED_OUT
        self._assign_task(
            node, ExplorationTask(choice.key, tuple(map(self.map.complex.snapshot_of, choice.path)), status)
        )

    def _uncoordinated(self, node: int, living: Sequence[int]) -> Choice | None:
        """Return the choice of a baseline, which may send several robots to one frontier."""
        if self._rules.strategy == "nearest-frontier":
            return nearest_frontier(self.map.complex, self._robots[node].landmarks, Offer(self.map.frontiers, ()))
        mine = frontier_costs(self.map.complex, self._robots[node].landmarks, self.map.frontiers)
        return min_pos(mine, [self._costs_of(other) for other in living if other != node])

    def _costs_of(self, node: int) -> Costs:
        """Return the cost of each frontier for a robot at its last reported place; at most RANK_TICKS old."""
        at, costs = self._costs.get(node, (-RANK_TICKS, None))
        if costs is None or self._tick - at >= RANK_TICKS:
            costs = frontier_costs(self.map.complex, self._robots[node].landmarks, self.map.frontiers)
            self._costs[node] = self._tick, costs
        return costs

    def _finish(self, living: Sequence[int]) -> bool:
        """Halt all robots, and return whether exploration is complete: no frontier is open, and no missing entry can
        open one.

        A map without an area is not explored: there are too few landmarks, or all are on one line. Robots then do a random
        walk and observe.
        """
        if any(robot.incarnation < 0 and self._tick < self._rules.dead_ticks for robot in self._robots.values()):
            return False
        robots = {node: self._robots[node] for node in living if self._robots[node].incarnation >= 0}
        if not robots:
            return False
        if not self.map.frontiers.has_area:
            for node, robot in robots.items():
                if robot.consider_at <= self._tick and (robot.task is None or robot.task.key is None):
                    self._give(node, None, cut_off=True)
            return False
        if any(robot.task is not None and robot.task.key is not None for robot in robots.values()):
            return False
        again = inconsistent(self.map.frontiers)
        if again:
            self.map.raise_all(again, REOPENED)
            return False
        for node, robot in robots.items():
            if robot.free and (robot.task is None or robot.task.walk):
                self._assign_task(node, ExplorationTask(None))
        return all(
            robot.task is not None
            and robot.task.key is None
            and not robot.task.walk
            and robot.free
            and robot.entries == self.replica.vector.get(self._origin_of(node), 0)
            for node, robot in robots.items()
        )

    def _assign_task(self, node: int, task: ExplorationTask, retry_ticks: int = RETRY_TICKS) -> None:
        robot = self._robots[node]
        robot.task_number += 1
        robot.task, robot.free, robot.retry_ticks = task, False, retry_ticks
        self._send_task(node, robot)

    def _send_task(self, node: int, robot: _Robot) -> None:
        assert robot.task is not None
        robot.sent_at = self._tick
        parts = cut(
            write_task(robot.task),
            self._incarnation,
            robot.incarnation,
            robot.task_number,
            self._rules.message_bytes_max,
        )
        self._send([AddressedMessage(node, part) for part in parts])

    def _send(self, outgoing: list[AddressedMessage]) -> None:
        self._outbox += [Transmission("uplink", messages.write(message), to) for to, message in outgoing]

    # --- telemetry --------------------------------------------------------------------------------------------------

    def _snapshot(self) -> bytes:
        """Return the new part of the map for the observers of the run."""
        first, last = self._reported_vertices, self.map.complex.vertices
        behind = last - first >= SIMPLICES_REPORTED_MAX
        if (self._tick % TELEMETRY_TICKS and not (self._done or behind)) or self.map.version == self._reported_version:
            return b""
        self._reported_vertices = min(last, first + SIMPLICES_REPORTED_MAX)
        if self._reported_vertices == last:
            self._reported_version = self.map.version
        seen = [self.map.complex.snapshot_of(vertex) for vertex in range(first, self._reported_vertices)]
        tasks = {node: robot.task for node, robot in self._robots.items()}
        assigned = tuple((node, *pair_of(task.key)) for node, task in tasks.items() if task and task.key is not None)
        frontiers = tuple(pair_of(key) for key in list(self.map.frontiers.open)[:FRONTIERS_REPORTED_MAX])
        count = len(self.map.frontiers.open)
        return write_report(
            MapReport(*columns(seen), open=count, done=self._done, frontiers=frontiers, assigned=assigned)
        )
