"""The coordinator of landmark-based exploration: the map of all robots, and who explores which frontier.

Algorithm 1 of Ramaithitima and Bhattacharya 2018. It knows what robots wrote into their logs, and the landmarks that a free
robot sees. If robots choose by themselves, it is only a hub that forwards their gossip.

It ends when no frontier is open, every robot has been halted, and it has all entries that robots wrote. A halted robot
adds nothing to its log. A robot that is silent for `dead_ticks` is presumed dead: its frontier is free again.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Any, Final, Protocol

import msgspec
from msgspec import Struct

from zwerm.agents.landmark_exploration.mapping.boundary_trace import inconsistent
from zwerm.agents.landmark_exploration.mapping.cost_utility import (
    Choice,
    Costs,
    Offer,
    Policy,
    cost_utility,
    frontier_costs,
    min_pos,
    nearest_frontier,
)
from zwerm.agents.landmark_exploration.mapping.frontier_status import ABANDONED, REOPENED, TIMED_OUT, pair_of
from zwerm.agents.landmark_exploration.mapping.landmark_map import FAILURES_MAX, LandmarkMap
from zwerm.agents.landmark_exploration.mapping.map_reports import MapReport, columns, write_report
from zwerm.agents.landmark_exploration.parameters import CentralStrategy, NonNegative, Ticks
from zwerm.agents.landmark_exploration.sharing import landmark_messages as messages
from zwerm.agents.landmark_exploration.sharing.landmark_messages import LARGE_BYTES, Entries, TaskReport, Vector
from zwerm.agents.landmark_exploration.sharing.log_gossip import Gossip, Said
from zwerm.agents.landmark_exploration.sharing.orders import ExplorationTask, cut, landmarks_in, write_task
from zwerm.agents.landmark_exploration.sharing.registers import Registers
from zwerm.agents.landmark_exploration.sharing.replica import Replica, Stretch, origin_of
from zwerm.wire.messages import Command, Observation, Transmission

# Ticks after which a robot that has nothing to explore is considered again: at first, and at most.
RETRY_TICKS: Final = 10
RETRY_TICKS_MAX: Final = 80
# Largest age [ticks] of the costs by which min-pos ranks the other robots.
RANK_TICKS: Final = 20
# Ticks between two tries of the same order.
SAY_AGAIN_TICKS: Final = 4
# Ticks between pictures of the map for those who watch the run.
TELEMETRY_TICKS: Final = 25
# Frontiers in one such picture, at most.
FRONTIERS_TOLD_MAX: Final = 1_500
SIMPLICES_TOLD_MAX: Final = 400
# Bytes of messages that it sends in one tick, at most: a command has to fit into one message to the world.
OUTBOX_BYTES_MAX: Final = 20_000


class CoordinatorParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """`beta` weighs the cost against the utility; `strategy` chooses frontiers; a robot silent for `dead_ticks` is dead."""

    beta: NonNegative = 10.0
    strategy: CentralStrategy = "cost-utility"
    dead_ticks: Ticks = 600
    message_bytes_max: int = LARGE_BYTES


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
    """The state of one robot, as far as it is known.

    `order` numbers the last order, and `task` is what it says; None: none yet.
    """

    incarnation: int = -1
    heard_at: int = 0
    order: int = 0
    task: ExplorationTask | None = None
    said_at: int = -1_000
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
        self._policy: Policy = cost_utility(rules.beta)
        self._costs: dict[int, tuple[int, Costs]] = {}
        self._failures: dict[int, int] = {}
        self._outbox: list[Transmission] = []
        self._acknowledge: dict[int, int] = {}
        self._told_version = -1
        self._told_vertices = 0
        self._done = False
        self._registers = Registers(rules.dead_ticks, rules.dead_ticks, setup.node)
        self._gossip: Gossip | None = None
        if setup.services.get("assignment", "coordinator") == "claims":
            self._gossip = Gossip(
                setup.node, self.replica, self._registers, self.map.read, rules.message_bytes_max, hub=True
            )

    def step(self, observation: Observation) -> Command:
        """Take the mail, assign frontiers, answer."""
        self._tick = observation.tick
        for packet in observation.inbox:
            message = messages.read(packet.payload)
            if message is None or packet.sender is None:
                continue
            if self._gossip is not None:
                self._gossip.hear(packet.sender, message, self._tick)
            elif isinstance(message, Entries):
                self._take(packet.sender, message)
            elif isinstance(message, TaskReport) and packet.sender in self._robots:
                self._hear(packet.sender, message)
        if self._gossip is None:
            self._acknowledge_all()
            self._done = self._assign()
        else:
            self._send(self._gossip.tick(self._tick, None))
            self._done = not self.map.frontiers.open and self._registers.concluded(self.replica.digest, self._tick)
        return Command(outbox=self._due(), done=self._done, snapshot=self._snapshot())

    def _due(self) -> tuple[Transmission, ...]:
        """Return what fits into one command; the rest waits for the next tick."""
        size = number = 0
        while number < len(self._outbox) and size < OUTBOX_BYTES_MAX:
            size += len(self._outbox[number].payload)
            number += 1
        due, self._outbox = tuple(self._outbox[:number]), self._outbox[number:]
        return due

    # --- what robots say --------------------------------------------------------------------------------------------

    def _take(self, sender: int, message: Entries) -> None:
        stretch = Stretch(message.origin, message.first, message.entries)
        held = self.replica.vector.get(stretch.origin, 0)
        new = self.replica.extend(stretch)
        if new:
            self.map.read(Stretch(stretch.origin, held, tuple(new)), held)
        self._acknowledge[sender] = stretch.origin

    def _acknowledge_all(self) -> None:
        for node, origin in self._acknowledge.items():
            counts = (origin, self.replica.vector.get(origin, 0))
            self._send([Said(node, Vector(origin, origin + 1, counts, ask=False))])
        self._acknowledge.clear()

    def _hear(self, node: int, report: TaskReport) -> None:
        robot = self._robots[node]
        if report.incarnation < robot.incarnation:
            return
        if report.incarnation > robot.incarnation:
            robot = self._robots[node] = _Robot(incarnation=report.incarnation)
        robot.heard_at = self._tick
        robot.entries = report.entries
        if report.entries > self.replica.vector.get(self._origin_of(node), 0):
            self._acknowledge.setdefault(node, self._origin_of(node))
        try:
            robot.landmarks = landmarks_in(report.landmarks)
        except ValueError:
            return
        has_newest = report.coordinator_incarnation == self._incarnation and report.order == robot.order
        if robot.task is None:
            robot.free = report.free
            robot.order = max(robot.order, report.order if report.coordinator_incarnation == self._incarnation else 0)
        elif has_newest and report.free and robot.task.key is not None:
            if not report.reached:
                self._failed(robot.task)
            robot.task, robot.free = None, True
        elif has_newest:
            robot.free = robot.task.key is None
        elif self._tick - robot.said_at >= SAY_AGAIN_TICKS:
            self._say(node, robot)

    def _failed(self, task: ExplorationTask) -> None:
        """Note that a robot did not get to its frontier; after a while that counts as a time-out."""
        assert task.key is not None
        failures = self._failures[task.key] = self._failures.get(task.key, 0) + 1
        if failures >= FAILURES_MAX:
            self.map.raise_all([task.key], task.status)

    def _origin_of(self, node: int) -> int:
        return origin_of(node, self._robots[node].incarnation)

    # --- assignment: algorithm 1 --------------------------------------------------------------------------------------

    def _assign(self) -> bool:
        """Send every free robot to the frontier that is best for it; return whether all is over.

        Lines 4 to 7 of algorithm 1. Of all pairs of a free robot and a frontier the best comes first.
        """
        living = [node for node, robot in self._robots.items() if self._tick - robot.heard_at < self._rules.dead_ticks]
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
        free = [node for node in living if self._robots[node].free and self._robots[node].consider_at <= self._tick]
        if not frontiers.open:
            pass
        elif self._rules.strategy == "cost-utility":
            self._greedy(free, offer)
        else:
            for node in free:
                self._give(node, self._uncoordinated(node, living), cut_off=True)
        return not frontiers.open and self._finish(living)

    def _greedy(self, free: Sequence[int], offer: Offer) -> None:
        """Give the best pair of a free robot and a frontier to each other, then the best of the rest, and so on.

        A robot's best gain never rises while frontiers are given away, so that only a robot that seems best is looked at again.
        """
        given = 0
        given_at: dict[int, int] = {}  # landmark: the number of the last frontier with it that was given away
        queue: list[tuple[float, int, int, Choice]] = []
        for node in free:
            self._consider(node, offer, given, queue)
        while queue:
            _, node, at, choice = heappop(queue)
            # Frontiers without a landmark of this one change nothing: all others are worth the same as before, or less.
            if any(given_at.get(landmark, 0) > at for landmark in pair_of(choice.key)):
                self._consider(node, offer, given, queue)
                continue
            given += 1
            given_at.update(dict.fromkeys(pair_of(choice.key), given))
            offer.take(choice.key)
            self._give(node, choice)

    def _give(self, node: int, choice: Choice | None, cut_off: bool = False) -> None:
        """Send a robot to a frontier; where there is none for it, consider it again later.

        A robot that is `cut_off`, since no way leads to what is free, walks about meanwhile.
        """
        if choice is None:
            robot = self._robots[node]
            robot.consider_at = self._tick + robot.retry_ticks
            robot.retry_ticks = min(2 * robot.retry_ticks, RETRY_TICKS_MAX)
            if cut_off and (robot.task is None or (robot.task.key is None and not robot.task.walk)):
                self._order(node, ExplorationTask(None, walk=True), retry_ticks=robot.retry_ticks)
            return
        status = ABANDONED if self.map.frontiers.statuses[choice.key] == REOPENED else TIMED_OUT
        self._order(node, ExplorationTask(choice.key, tuple(map(self.map.complex.snapshot_of, choice.path)), status))

    def _uncoordinated(self, node: int, living: Sequence[int]) -> Choice | None:
        """Return the choice of a baseline, which is free to send several robots to one frontier."""
        if self._rules.strategy == "nearest-frontier":
            return nearest_frontier(self.map.complex, self._robots[node].landmarks, Offer(self.map.frontiers, ()))
        mine = frontier_costs(self.map.complex, self._robots[node].landmarks, self.map.frontiers)
        return min_pos(mine, [self._costs_of(other) for other in living if other != node])

    def _costs_of(self, node: int) -> Costs:
        """Return the cost of each frontier for a robot at its last reported place, by a search that may be a little old."""
        at, costs = self._costs.get(node, (-RANK_TICKS, None))
        if costs is None or self._tick - at >= RANK_TICKS:
            costs = frontier_costs(self.map.complex, self._robots[node].landmarks, self.map.frontiers)
            self._costs[node] = self._tick, costs
        return costs

    def _consider(self, node: int, offer: Offer, given: int, queue: list[tuple[float, int, int, Choice]]) -> None:
        choice = self._policy(self.map.complex, self._robots[node].landmarks, offer)
        if choice is not None:
            heappush(queue, (-choice.gain, node, given, choice))
        else:
            self._give(node, None, cut_off=not offer.is_empty())

    def _finish(self, living: Sequence[int]) -> bool:
        """Halt all robots, and return whether all is explored: nothing is open, and no entry of a robot's log will open
        anything.

        A map without an area is not explored: landmarks are too few, or in one line. Robots then walk about and look.
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
                self._order(node, ExplorationTask(None))
        return all(
            robot.task is not None
            and robot.task.key is None
            and not robot.task.walk
            and robot.free
            and robot.entries == self.replica.vector.get(self._origin_of(node), 0)
            for node, robot in robots.items()
        )

    def _order(self, node: int, task: ExplorationTask, retry_ticks: int = RETRY_TICKS) -> None:
        robot = self._robots[node]
        robot.order += 1
        robot.task, robot.free, robot.retry_ticks = task, False, retry_ticks
        self._say(node, robot)

    def _say(self, node: int, robot: _Robot) -> None:
        assert robot.task is not None
        robot.said_at = self._tick
        parts = cut(
            write_task(robot.task), self._incarnation, robot.incarnation, robot.order, self._rules.message_bytes_max
        )
        self._send([Said(node, part) for part in parts])

    def _send(self, said: list[Said]) -> None:
        self._outbox += [Transmission("uplink", messages.write(message), to) for to, message in said]

    # --- for those who watch ----------------------------------------------------------------------------------------

    def _snapshot(self) -> bytes:
        """Return the map, as far as it has changed, for those who watch the run."""
        first, last = self._told_vertices, self.map.complex.vertices
        behind = last - first >= SIMPLICES_TOLD_MAX
        if (self._tick % TELEMETRY_TICKS and not (self._done or behind)) or self.map.version == self._told_version:
            return b""
        self._told_vertices = min(last, first + SIMPLICES_TOLD_MAX)
        if self._told_vertices == last:
            self._told_version = self.map.version
        seen = [self.map.complex.snapshot_of(vertex) for vertex in range(first, self._told_vertices)]
        tasks = {node: robot.task for node, robot in self._robots.items()}
        assigned = tuple((node, *pair_of(task.key)) for node, task in tasks.items() if task and task.key is not None)
        frontiers = tuple(pair_of(key) for key in list(self.map.frontiers.open)[:FRONTIERS_TOLD_MAX])
        count = len(self.map.frontiers.open)
        return write_report(
            MapReport(*columns(seen), open=count, done=self._done, frontiers=frontiers, assigned=assigned)
        )
