"""The world: physics, sensing, the radio and virtual time, without any I/O.

One tick goes: `observe` (sense at t_k, for the nodes that are awake), then one `accept` for every answer that came, then
`advance` (apply the commands in id order, send their packets, move the bodies to t_k+1). Whoever drives the world decides
when to advance: the lock-step driver when all have answered, the real-time driver when the clock says so.

The world is deterministic: its state after a tick is a function of the scenario, the seed and the accepted answers.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import chain, repeat
from typing import Any, Protocol

import numpy as np

from zwerm.catalogue import BASE
from zwerm.errors import ProtocolError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import (
    SENSOR_FIELDS,
    BodyVelocity,
    Command,
    Failure,
    Observation,
    Transmission,
    WheelSpeeds,
    encode,
)
from zwerm.wire.trace import Trace
from zwerm.world.arena.arena import Arena
from zwerm.world.arena.entrance import Depots, EntrySchedule
from zwerm.world.arena.placement import place
from zwerm.world.bodies.drives import Drives
from zwerm.world.bodies.physics import Physics
from zwerm.world.faults import Fault, ticks
from zwerm.world.faults.generator import scheduled
from zwerm.world.faults.schedule import Schedule, unite
from zwerm.world.faults.sensing import read
from zwerm.world.metrics.observers import Observers
from zwerm.world.radio.medium import Medium
from zwerm.world.scene import Bools, Floats, Ints, Scene
from zwerm.world.sensors import Sensor
from zwerm.world.tick.command_intake import CommandIntake
from zwerm.world.tick.node_status import NodeStatus, ProcessAction
from zwerm.world.tick.precompute import PrecomputedReadings, Readings
from zwerm.world.tick.telemetry import TelemetrySink
from zwerm.world.tick.wakes import SIGNATURES, Wakes

Send = Callable[[int, bytes], object]


class ExchangeRecorder(Protocol):
    """Keeps what crossed the link, tick by tick."""

    def exchange(
        self, tick: int, nodes: Sequence[int], observations: Sequence[bytes], answers: Sequence[bytes], scene: Scene
    ) -> None:
        """Keep one tick: the observations sent to `nodes`, their answers (b"" for none), and the scene."""


class World:
    """One run's world. Every robot carries the `sensors`; `seed` keys all randomness.

    `observers` are the run's metrics; the runner has them take samples.
    """

    def __init__(
        self, scenario: Scenario, seed: int, arena: Arena, sensors: Sequence[Sensor], observers: Observers | None = None
    ) -> None:
        count, body = scenario.robots.count, scenario.robots.body
        self.scenario = scenario
        self.arena = arena
        self.observers = observers or Observers()
        self.draws = Draws(seed)
        self.tick = 0
        self.count = count
        self.robot_ticks = 0
        self.crashed: dict[int, str] = {}
        self.failures: dict[int, Failure] = {}
        self.exited: list[int] = []
        self.telemetry = TelemetrySink(scenario.time.dt_s)
        self.observers.subscribe(self.telemetry)
        self.trace = Trace()
        self.recording: ExchangeRecorder | None = None
        self.coordinator = count if scenario.coordinator is not None else None
        self.medium = Medium(scenario, arena, self.draws)
        self._physics = Physics(body, arena.segments, count, scenario.time.dt_s)
        self._drives = Drives(body, count, self.draws)
        nodes = count + (self.coordinator is not None)
        self._wakes = Wakes(nodes, scenario.time.dt_s)
        self.fault_tables = scheduled(scenario, seed, arena)
        self.schedule = Schedule(self.fault_tables, scenario, self.draws)
        self.lives = NodeStatus(nodes, self.schedule.late_joiners)
        for node in self.schedule.late_joiners:
            self.medium.switch_off(node, "receiver-down")
        self._blinding: list[Fault] = []
        self._deadman_at: dict[int, int] = {}  # the tick at which a paused robot's motors stop
        self._sensors = {sensor.field: sensor for sensor in sensors}
        # One column of readings a field, up to the last field that any sensor fills.
        last = max((SENSOR_FIELDS.index(field) for field in self._sensors), default=-1)
        self._columns = SENSOR_FIELDS[: last + 1]
        self._done: Bools = np.zeros(nodes, dtype=np.bool_)
        self._any_done = False
        stations = range(scenario.base.stations if scenario.base is not None else 0)
        centre = [] if self.coordinator is None else [self.coordinator]
        bases_decide = scenario.variant is not None and scenario.variant.decides == BASE
        self._deciding = [*([] if bases_decide else centre), *stations]
        self.answers = CommandIntake(self._drives.kind, body.kind, [*centre, *stations], self.medium)
        self.refused = self.answers.refused
        self._present: Bools = np.zeros(count, dtype=np.bool_)
        self._robots: Ints = np.zeros(0, dtype=np.int64)  # those that were observed last
        self._coming: Scene | None = None
        self._foreseen: PrecomputedReadings | None = None
        self._nodes: list[int] = []
        self._observations: list[bytes] = []
        self._outboxes: list[tuple[int, tuple[Transmission, ...]]] = []
        self._inflow = EntrySchedule(scenario.robots.inflow, count) if scenario.robots.inflow else None
        self._depots = Depots(scenario.base, count, arena, body.radius_m, self.draws) if scenario.base else None
        if self.coordinator is not None:
            self._admit(self.coordinator)
        if self._depots is not None:
            for base in stations:
                self._physics.fix(base, self._depots.position[base], float(self._depots.heading[base]))
                self._set_present(base, True)
                self._admit(base)
        elif self._inflow is None:
            positions, headings = place(scenario.robots.placement, arena, count, body.radius_m, self.draws)
            for robot in range(count):
                self._enter(robot, positions[robot], float(headings[robot]))
        self.scene = self._look(np.ones(count, dtype=np.bool_), 0)
        self._let_in_and_out()

    # --- one tick, in order -----------------------------------------------------------------------------------------

    def begin(self) -> list[ProcessAction]:
        """Let the faults of this tick happen, and return what is to be done to programs before anybody is observed."""
        orders: list[ProcessAction] = []
        if self.schedule.faults and self.schedule.turn(self.tick, self.scene, self.dead):
            changes = self.lives.change(*self.schedule.states(self.tick))
            restarts = [node for node in self.schedule.restarts() if not self.lives.down[node]]
            orders = [order for order in unite(changes, restarts) if self._happens(order)]
            self.medium.faults = self.schedule.on_air()
            self._blinding = self.schedule.on_sensors()
        for node, tick in list(self._deadman_at.items()):
            if self.tick >= tick:
                self.halt(node)
                del self._deadman_at[node]
        return orders

    def observe(self, send: Send | None = None) -> tuple[list[int], list[bytes]]:
        """Sense, and return the ids of the nodes that are awake, ascending, with each one's encoded observation.

        With `send` each node's is sent as soon as it is encoded: the first work on it while the others' are made.
        """
        scene, tick = self.scene, self.tick
        receivers = self.medium.arrive(tick)
        if self._wakes.sleeping:
            self._wakes.note_packets(receivers, tick)
            self._note_changes()
        awake = self.lives.able(self._wakes.awake(tick), tick)
        nodes: list[int] = awake.tolist()
        # Ids ascend, and the coordinator's, which has no sensors, is the largest.
        robots = awake[:-1] if nodes and nodes[-1] == self.coordinator else awake
        readings = self._readings(robots)
        inboxes: Any = self.medium.deliver(nodes, tick) if receivers else repeat(())
        columns: list[Any] = [readings.get(field, repeat(None)) for field in self._columns]
        ticks, times = repeat(tick, len(robots)), repeat(scene.time_s)
        made: Iterator[Observation] = map(Observation, ticks, times, inboxes, *columns)
        if len(robots) < len(nodes):
            made = chain(made, (Observation(tick, scene.time_s, inboxes[-1] if receivers else ()),))
        self._nodes, self._observations = nodes, []
        for node, observation in zip(nodes, map(encode, made), strict=True):
            self._observations.append(observation)
            if send is not None:
                send(node, observation)
        # What nobody waits for comes last.
        self.answers.ask(nodes, tick)
        self.robot_ticks += len(nodes)
        for field in SIGNATURES:
            if field in readings:
                self._wakes.remember(field, nodes[: len(robots)], readings[field])
        return nodes, self._observations

    def foresee(self) -> None:
        """Work out what does not hang on the answers to this tick's observations: best while the nodes work on them.

        Where commands act a tick later or more, that is the motion of the bodies, and, as long as everybody is awake, what the
        same robots sense after it; `observe` takes that if nothing came between.
        """
        self.trace.catch_up()
        self._move_early()
        if self._coming is not None and len(self._robots) and not (self._wakes.sleeping or self._blinding):
            self._foreseen = PrecomputedReadings(self._coming, self._robots, self._sense(self._coming, self._robots))

    def accept(self, node: int, payload: bytes) -> None:
        """Take a node's answer to its observation of this tick, or in real time to an earlier one.

        Raises ProtocolError, and counts its reason, for what is malformed or unasked for; the node is still awaited then.
        Telemetry that breaks the rules counts too, and is a crash of the node: the run goes on or ends by `on_crash`.
        """
        try:
            answer = self.answers.hear(node, payload)
        except ProtocolError as error:
            if error.reason != "telemetry" or node not in self.awaited():
                raise
            # Its controller is at fault, and gives no other answer to this observation.
            self._move_early()
            self.crash(node, f"refused: {error}")
            return
        if type(answer) is Failure:
            self.failures[node] = answer
            self._move_early()  # whether it was done already or not, the motors stop after this tick
            self.crash(node, answer.error)

    def awaited(self) -> list[int]:
        """Return the nodes whose answer to this tick's observation has not come, ascending."""
        return [node for node in self.answers.owing() if node not in self.crashed]

    def advance(self) -> None:
        """Apply what was accepted, in id order, and go on to the next tick."""
        self.trace.catch_up()
        self._move_early()
        payloads, traced, commands = self.answers.close()
        self._apply(self.lives.finished(commands, self.tick))
        self.trace.extend(self.tick, self._nodes, self._observations, traced)
        if self.recording is not None:
            self.recording.exchange(self.tick, self._nodes, self._observations, payloads, self.scene)
        if self._outboxes:
            self.medium.send(self.scene, self._outboxes)
            self._outboxes = []
        self.scene, self._coming = self._coming or self._move(), None
        self.tick += 1
        self._let_in_and_out()

    # --- what happens to robots -------------------------------------------------------------------------------------

    def crash(self, node: int, reason: str) -> None:
        """Take note that a node is dead: its motors stop, it is never awaited again, its body stays where it is."""
        if node not in self.crashed and not self.lives.down[node]:
            self.crashed[node] = reason
            self._retire(node, "receiver-crashed")

    def halt(self, node: int) -> None:
        """Stop a robot's motors until its next command."""
        if node < self.count:
            self._drives.stop(node)

    @property
    def completed(self) -> bool:
        """Tell whether the task is done: the coordinator says so, or the base station does, or all robots that live do.

        Where there is a coordinator that finds the path, it decides; else the base station, if there is one. Robots that left
        count as done.
        """
        if self._deciding:
            return bool(self._done[self._deciding[0]])
        if not (self._any_done or self.exited):
            return False
        over = self._done.copy()
        over[self.exited] = True
        dead = self.dead
        over[dead] = True
        return bool(over.all()) and len(dead) < self.count

    @property
    def dead(self) -> list[int]:
        """The nodes that are down and will never return, ascending."""
        return sorted({*self.crashed, *self.schedule.gone()})

    @property
    def done_fraction(self) -> float:
        """The fraction of robots that say that their part is done, in their newest command."""
        return float(self._done[: self.count].mean())

    @property
    def time_s(self) -> float:
        """Virtual time [s]."""
        return self.tick * self.scenario.time.dt_s

    # --- inside -----------------------------------------------------------------------------------------------------

    def _decides(self, node: int) -> bool:
        """Tell whether a node may give up for all: the coordinator, or a base station where there is none any more."""
        centre = self.coordinator
        return node in self._deciding and (centre not in self._deciding or node == centre or centre in self.dead)

    def _move_early(self) -> None:
        """Move the bodies, once a tick, if no answer to its observations has a say in that."""
        if self._drives.lagging and self._coming is None:
            self._coming = self._move()

    def _move(self) -> Scene:
        """Move the bodies to the next tick, and return how things are then."""
        moved = self._physics.advance(*self._drives.velocities(self.tick))
        return self._look(moved, self.tick + 1)

    def _look(self, moved: Bools, tick: int) -> Scene:
        physics = self._physics
        return Scene(
            tick,
            tick * self.scenario.time.dt_s,
            physics.position.copy(),
            physics.heading.copy(),
            self._present,
            moved,
            self.scenario.robots.body.radius_m,
            self.arena,
            self.draws,
        )

    def _let_in_and_out(self) -> None:
        """Let robots enter and leave at the start of a tick, and look again if any did."""
        door = self._inflow or self._depots
        if door is None:
            return
        leaving = door.leaving(self.scene).tolist()
        for robot in leaving:
            self._physics.remove(robot)
            self._set_present(robot, False)
            self.exited.append(robot)
            self._retire(robot, "receiver-left")
        entering = door.entering(self.scene)
        if entering is not None:
            self._enter(*entering)
        if leaving or entering is not None:
            changed = self.scene.moved.copy()
            changed[leaving if entering is None else [*leaving, entering[0]]] = True
            self.scene = self._look(changed, self.tick)

    def _enter(self, robot: int, position: Floats, heading: float) -> None:
        self._physics.add(robot, position, heading)
        self._set_present(robot, True)
        self._admit(robot)

    def _admit(self, node: int) -> None:
        """Let a node be observed from now on, if its program runs."""
        if not self.lives.down[node]:
            self._wakes.admit(node)

    def _set_present(self, robot: int, present: bool) -> None:
        self._present = self._present.copy()  # scenes of earlier ticks keep theirs
        self._present[robot] = present

    def _retire(self, node: int, cause: str) -> None:
        self._wakes.retire(node)
        if node < self.count:
            self._drives.stop(node)
        self.medium.switch_off(node, cause)

    def _readings(self, robots: Ints) -> Readings:
        """Return what each of `robots` senses now, by field."""
        foreseen, self._foreseen, self._robots = self._foreseen, None, robots
        if foreseen is not None and not self._blinding and foreseen.holds(self.scene, robots):
            return foreseen.readings
        return self._sense(self.scene, robots) if len(robots) else {}

    def _sense(self, scene: Scene, robots: Ints) -> Readings:
        return {field: self._read(sensor, scene, robots) for field, sensor in self._sensors.items()}

    def _read(self, sensor: Sensor, scene: Scene, robots: Ints) -> Sequence[Any]:
        return read(sensor, self._blinding, scene, robots) if self._blinding else sensor.read(scene, robots)

    def _happens(self, order: ProcessAction) -> bool:
        """Let what an order does to a program have its effect on the world; tell whether there is a program to do it to."""
        deed, node = order
        if deed == "kill":
            alive = self.crashed.pop(node, None) is None
            self.lives.note("crashed", node)
            self.lives.forget(node)
            self._retire(node, "receiver-crashed")
            self._done[node] = False
            self._deadman_at.pop(node, None)
            return alive
        if deed == "start":
            if node in self.lives.ever.get("crashed", ()):
                self.lives.note("restarted", node)
            if node not in self.exited:
                self.medium.switch_on(node)
            if node == self.coordinator or self._present[node]:
                self._admit(node)
        elif deed == "pause":
            self._deadman_at[node] = self.tick + ticks(self.scenario.time.deadman_s, self.scenario.time.dt_s)
        else:
            self._deadman_at.pop(node, None)
        return node not in self.crashed

    def _note_changes(self) -> None:
        """Wake the sleepers whose contacts or visible ids have changed."""
        if not self.scene.moved.any():
            return
        for field in SIGNATURES:
            sensor = self._sensors.get(field)
            if sensor is not None and len(watchers := self._wakes.watchers(field)):
                self._wakes.note_readings(field, watchers, self._read(sensor, self.scene, watchers), self.tick)

    def _apply(self, answers: list[tuple[int, Command | Failure]]) -> None:
        drives: dict[int, BodyVelocity | WheelSpeeds] = {}
        done = self._done
        for node, answer in answers:
            if type(answer) is not Command:
                continue
            if answer.drive is not None:
                drives[node] = answer.drive
            if answer.outbox:
                self._outboxes.append((node, answer.outbox))
            if answer.wake is not None:
                self._wakes.sleep(node, answer.wake, self.tick)
            if answer.telemetry or answer.snapshot or answer.gave_up:
                self.telemetry.accept(self.scene, node, answer, self._decides(node))
            if answer.release and self._depots is not None and node < self._depots.stations:
                self._depots.release(node)
            if answer.done or self._any_done:
                done[node] = answer.done
                self._any_done = True
        if drives:
            self._drives.command(drives)
