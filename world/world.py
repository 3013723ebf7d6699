"""The world: physics, sensing, the radio and virtual time, without any I/O.

One tick is, in this order:

1. `begin`: faults of tick t_k take effect.
2. `observe`: sense at t_k, for the nodes that are awake; the driver sends the observations.
3. `precompute`: work ahead while the nodes compute.
4. `accept`: take each answer; `awaited` are the nodes whose command is still missing.
5. `advance`: apply the commands in id order, give their packets to the radio, and move the bodies to t_k+1.

A driver decides when to advance. In lock-step that is when all nodes have answered, in real time by the clock. `ending`
informs the driver when the run is over.

The world is deterministic: its state after a tick is a function of the scenario, the seed and the accepted answers.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import tee
from typing import Final

from msgspec.structs import replace

from zwerm.errors import ProtocolError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import BodyVelocity, Command, Failure, Transmission, WheelSpeeds
from zwerm.wire.text import printable, printable_line
from zwerm.wire.trace import Trace
from zwerm.world.arena.arena import Arena
from zwerm.world.bodies.bodies import Bodies
from zwerm.world.faults import ticks
from zwerm.world.faults.generator import scheduled
from zwerm.world.faults.schedule import Schedule, unite
from zwerm.world.radio.medium import Medium
from zwerm.world.scene import Scene
from zwerm.world.sensors import Sensor
from zwerm.world.tick.clocks import Clocks
from zwerm.world.tick.command_intake import CommandIntake
from zwerm.world.tick.completion import Completion, Ending
from zwerm.world.tick.lifecycle import Lifecycle
from zwerm.world.tick.node_status import NodeAnswer, NodeStatus, ProcessAction
from zwerm.world.tick.sensing import Sensing
from zwerm.world.tick.telemetry import TelemetrySink
from zwerm.world.tick.wakes import WakeEvent, Wakes

SendMany = Callable[[Iterable[tuple[int, bytes]]], object]


# A node with this many refused messages has crashed: a correct program has none, and each costs the world time.
FLOOD: Final = 1_000


class World:
    """One run's world. Every robot carries the `sensors`; `seed` keys all randomness.

    Its parts, each with its own state: `bodies`, `medium` (the radio), `schedule` (of faults), `status` (of nodes),
    `completion`, `intake` (of commands), `telemetry` and `trace`.
    """

    def __init__(self, scenario: Scenario, seed: int, arena: Arena, sensors: Sequence[Sensor]) -> None:
        """Raises ScenarioError for mistakes in the radio's models and the faults, and where there is no room."""
        draws, robots, dt_s = Draws(seed), scenario.robots.count, scenario.time.dt_s
        coordinator = [robots] if scenario.coordinator is not None else []
        stations = range(scenario.base.stations if scenario.base is not None else 0)
        nodes = robots + len(coordinator)
        self.scenario = scenario
        self.medium = Medium(scenario, arena, draws)
        self.schedule = Schedule(scheduled(scenario, seed, arena), scenario, draws)
        self.bodies = Bodies(scenario, arena, draws)
        self.status = NodeStatus(nodes, self.schedule.late_joiners)
        self.completion = Completion(scenario)
        fixed = [*coordinator, *stations]
        self.intake = CommandIntake(self.bodies.drives.kind, scenario.robots.body.kind, fixed, self.medium)
        self.telemetry = TelemetrySink(dt_s)
        self.trace = Trace()
        self.on_flood: Callable[[int], object] = lambda node: None  # stops the messages of a node that floods the world
        self.place_of: Callable[[int], str] = lambda node: (
            ""
        )  # the place of a node's controller: " (file.py:12, in C.step)"
        self._sensing = Sensing(sensors)
        clock = scenario.robots.clock
        self.clocks = None if clock is None else Clocks(clock, robots, nodes, draws)
        events = {
            each.field: WakeEvent(each.wake_event, each.signature, each.signature(each.rest()))
            for each in sensors
            if each.wake_event
        }
        self._wakes = Wakes(nodes, dt_s, events)
        deadman_ticks = ticks(scenario.time.deadman_s, dt_s)
        self._lifecycle = Lifecycle(self.status, self._wakes, self.bodies, self.medium, self.completion, deadman_ticks)
        for node in [*self.scene.present_ids().tolist(), *coordinator]:
            self._lifecycle.admit(node)
        self._lifecycle.pass_entrance()

    # --- one tick, in order -----------------------------------------------------------------------------------------

    def begin(self) -> list[ProcessAction]:
        """Let the faults of this tick take effect, and return the actions to carry out on programs before `observe`."""
        actions: list[ProcessAction] = []
        schedule, status, tick = self.schedule, self.status, self.tick
        if schedule.faults and schedule.turn(tick, self.scene, status.dead):
            changes = status.change(*schedule.states(tick))
            restarts = [node for node in schedule.restarts() if not status.down[node]]
            status.gone = schedule.gone()
            actions = [each for each in unite(changes, restarts) if self._lifecycle.apply(each, tick)]
            self.medium.faults = schedule.on_air()
            self._sensing.faults = schedule.on_sensors()
        self._lifecycle.stop_paused(tick)
        return actions

    def observe(self, send_many: SendMany | None = None) -> tuple[list[int], list[bytes]]:
        """Sense, and return the ids of the nodes that are awake, ascending, and the encoded observation of each.

        `send_many` takes each observation as soon as it is encoded, so that nodes start while others are still encoded.
        """
        scene, tick = self.scene, self.tick
        receivers = self.medium.arrive(tick)
        if self._wakes.sleeping:
            self._wakes.note_packets(receivers, tick)
            self._wake_on_changes()
        awake = self.status.observable(self._wakes.awake(tick), tick)
        nodes: list[int] = awake.tolist()
        # Ids ascend, and the coordinator, which has no sensors, has the largest.
        robots = awake[:-1] if nodes and nodes[-1] == self.scenario.robots.count else awake
        readings = self._sensing.readings(scene, robots)
        inboxes = self.medium.deliver(nodes, tick) if receivers else None
        times = None if self.clocks is None else self.clocks.local_s(scene.time_s, nodes)
        made = self._sensing.observations(scene, len(robots), len(nodes), readings, inboxes, times)
        if send_many is not None:
            sent, made = tee(made)
            send_many(zip(nodes, sent, strict=True))
        observations = list(made)
        # Bookkeeping comes after sending: the nodes work meanwhile.
        self.intake.begin_tick(tick, nodes, observations)
        for field in self._wakes.events:
            if field in readings:
                self._wakes.remember(field, nodes[: len(robots)], readings[field])
        return nodes, observations

    def precompute(self) -> None:
        """Compute what does not depend on the answers to this tick's observations: best while the nodes work.

        With a latency of one tick or more this moves the bodies. While all nodes are awake it also computes the next
        readings of the same robots. `observe` uses these readings if nothing changed in between.
        """
        self.trace.catch_up()
        next_scene = self.bodies.advance_early()
        if next_scene is not None and not self._wakes.sleeping:
            self._sensing.precompute(next_scene)

    def accept_plain(self, arrivals: Iterator[tuple[int, bytes | None]]) -> tuple[int, tuple[int, bytes | None] | None]:
        """Accept valid commands for this tick up to the first arrival that is none; return their number, and that arrival.

        That arrival is None if there is none; else it is for `accept`, or reports a loss.
        """
        return self.intake.accept_plain(arrivals, self.status.crashed)

    def accept(self, node: int, payload: bytes, late_allowed: bool = False) -> None:
        """Accept a node's answer to its observation of this tick, or with `late_allowed` of an earlier one.

        Raises ProtocolError, and counts its reason, for a stray message; the node is still awaited then. A controller that
        raised has crashed. So has one whose answer is refused: it gives no other.
        """
        if node in self.status.crashed:  # a program that has crashed controls no body any more
            self.intake.refusals.count(node, "crashed")
            raise ProtocolError("crashed", f"node {node} crashed at tick {self.status.crash_ticks[node]}")
        try:
            answer = self.intake.accept(node, payload, late_allowed)
        except ProtocolError as error:
            if self.intake.refusals.of_node(node) == FLOOD:
                self.evict(node, f"{FLOOD} of its messages were refused, the last one as {error}")
            if error.stray or not (late_allowed or self.intake.is_pending(node)):
                raise
            reason = f"its command was refused: {error}{self.place_of(node)}"
        else:
            if type(answer) is not Failure:
                return
            self.status.failures[node] = replace(answer, traceback=printable(answer.traceback))
            reason = answer.error
        self.bodies.advance_early()  # the motors stop after this tick, whether it was computed early or not
        self.crash(node, reason)

    def awaited(self) -> list[int]:
        """Return the nodes whose answer to this tick's observation has not come, ascending."""
        return [node for node in self.intake.pending() if node not in self.status.crashed]

    def advance(self) -> None:
        """Apply the accepted commands in id order, let the radio and the bodies act, and go on to the next tick."""
        tick = self.tick
        self.trace.catch_up()
        self.bodies.advance_early()
        answers = self.intake.end_tick()
        outboxes = self._apply(self.status.due_answers(answers, tick))
        exchange = self.intake.exchange
        self.trace.extend(tick, exchange.nodes, exchange.observations, exchange.traced)
        if outboxes:
            self.medium.send(self.scene, outboxes)
        self.bodies.advance()
        self._lifecycle.pass_entrance()

    # --- for the driver, between these steps ------------------------------------------------------------------------

    def ending(self, within_tick: bool = False) -> Ending | None:
        """Return how the run ends before this tick, or None if it goes on; `within_tick` only a crash ends it."""
        if within_tick:
            return self.completion.crash_ending(self.tick, self.status.crashed)
        return self.completion.ending(self.tick, self.status.crashed, self.bodies.exited, self.status.dead)

    def crash(self, node: int, reason: str) -> None:
        """Record that a node's program ended: its motors stop, it is never awaited again, its body stays where it is."""
        self.status.crash_ticks.setdefault(node, self.tick)
        self._lifecycle.crash(node, printable_line(reason))

    def evict(self, node: int, reason: str) -> None:
        """Record that a node has crashed because it floods the run, and stop its messages."""
        self.bodies.advance_early()  # its motors stop after this tick, whether it was computed early or not
        self.crash(node, f"flood: {reason}")
        self.on_flood(node)

    def withhold(self, node: int, withheld: bool) -> None:
        """Exclude a node from observation, or include it again."""
        self.status.withheld[node] = withheld

    def stop(self, node: int) -> None:
        """Stop a robot's motors until its next command."""
        self.bodies.stop(node)

    def newest_answer(self, node: int) -> int:
        """Return the tick of the newest answer accepted from a node, where answers may be late; -1 for none."""
        return self.intake.newest_tick(node)

    def refuse_stale(self, node: int) -> None:
        """Count a message that a former incarnation of a node sent."""
        self.intake.refusals.count(node, "stale-incarnation")

    # --- the truth --------------------------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """The truth at the current tick."""
        return self.bodies.scene

    @property
    def tick(self) -> int:
        """The number of the current tick, from 0."""
        return self.bodies.scene.tick

    @property
    def dead(self) -> list[int]:
        """The nodes that are down and never return, ascending."""
        return self.status.dead

    @property
    def completed(self) -> bool:
        """True if the task is done."""
        return self.completion.completed(self.bodies.exited, self.status.dead)

    # --- inside -----------------------------------------------------------------------------------------------------

    def _wake_on_changes(self) -> None:
        """Wake the sleepers whose contacts or visible ids have changed."""
        if not (self._wakes.watching and self.scene.moved.any()):
            return
        for field in self._wakes.events:
            if not len(watchers := self._wakes.watchers(field)):
                continue
            reach_m = self._sensing.reach_at_rest_m(field, self.scene)
            if reach_m is not None:
                watchers = watchers[~self._wakes.at_rest(field, watchers) | self.scene.moved_near(watchers, reach_m)]
            if len(watchers):
                readings = self._sensing.read(field, self.scene, watchers)
                self._wakes.note_readings(field, watchers, readings, self.tick, reach_m is not None)

    def _apply(self, answers: Sequence[NodeAnswer]) -> list[tuple[int, tuple[Transmission, ...]]]:
        """Apply commands, and return the packets they send: (node, its outbox), in the order of `answers`."""
        drives: dict[int, BodyVelocity | WheelSpeeds] = {}
        outboxes: list[tuple[int, tuple[Transmission, ...]]] = []
        completion, tick = self.completion, self.tick
        for node, answer in answers:
            if type(answer) is not Command:
                continue
            if answer.drive is not None:
                drives[node] = answer.drive
            if answer.outbox:
                outboxes.append((node, answer.outbox))
            if answer.wake is not None:
                wake = answer.wake if self.clocks is None else self.clocks.true_wake(node, answer.wake)
                self._wakes.sleep(node, wake, tick)
            if answer.telemetry or answer.snapshot:
                self.telemetry.accept(self.scene, node, answer, self.status.down)
            if answer.gave_up or completion.any_gave_up:
                completion.give_up(node, answer.gave_up, self.status.dead)
            if answer.release:
                self.bodies.release(node)
            if answer.done or completion.any_done:
                completion.report(node, answer.done)
        if drives:
            self.bodies.drive(drives)
        return outboxes
