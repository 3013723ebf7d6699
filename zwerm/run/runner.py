"""Running a scenario: inline in this process, or with every robot a process of its own."""

import gc
import secrets
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, Protocol, get_args

import numpy as np

from zwerm.agents.runtime.confinement import UNCONFINED, Confinement
from zwerm.agents.runtime.fork_guard import refuse_forks
from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs, restart_spec
from zwerm.errors import ScenarioError, StragglerError
from zwerm.link import NodeProcesses, WorldLink
from zwerm.link.memory import MemoryLink
from zwerm.record.history import History
from zwerm.run.assembly import assemble_run, observers_of
from zwerm.run.controller_checks import make_again, try_controllers
from zwerm.run.denial_guard import DenialGuard
from zwerm.run.hang_guard import constructors_guarded, hang_guard
from zwerm.run.kept_result import KeptResult
from zwerm.run.measurement import measure, truth_of
from zwerm.run.progress import NullProgress, ProgressListener
from zwerm.run.result import RunResult
from zwerm.scenario.load import load
from zwerm.scenario.nearest import did_you_mean
from zwerm.scenario.tables import Scenario
from zwerm.wire.refusals import Refusals
from zwerm.world.drivers.driver import TickObserver
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.drivers.realtime import RealTime
from zwerm.world.metrics.observers import Observers
from zwerm.world.metrics.position_coverage import cell_counts
from zwerm.world.radio.report import radio_report
from zwerm.world.scene import Scene
from zwerm.world.tick.completion import FAILED, INTERRUPTED
from zwerm.world.tick.node_status import Event
from zwerm.world.world import World

if TYPE_CHECKING:  # an inline run needs no transport
    from zwerm.deploy.security_log import SecurityLog

Runner = Literal["processes", "inline"]

# The slowest pace of a run in real time, as a factor of the wall clock.
REALTIME_MIN: Final = 1e-6

# The samples of positions that a run's history holds for pictures, and the progress reports of a run, at most about.
HISTORY_SAMPLES: Final = 4_000
PROGRESS_REPORTS: Final = 1_000

# The events, besides crashes and restarts, that a result lists nodes for.
HINDRANCES: Final[tuple[Event, ...]] = ("paused", "slow", "late")


def run(
    scenario: str | Path | Scenario,
    seed: int = 1,
    runner: Runner = "processes",
    overrides: Sequence[str] = (),
    realtime: float | None = None,
    watcher: ProgressListener | None = None,
    record: Path | None = None,
    security_log: Path | None = None,
    confinement: Confinement = UNCONFINED,
) -> RunResult:
    """Run `scenario` (a built-in name, a path, or a loaded scenario) and return its result.

    `overrides` are `path=value` strings; `realtime` paces the run at that factor of the wall clock; `record` is a file
    to write an MCAP recording to. `security_log` is a file for all that world and router refuse; with processes it takes over
    descriptor 1 of this process (see `zwerm.deploy.router_messages`). `confinement` limits the robots' processes.
    Raises ScenarioError for a mistake in the scenario, and LinkError where robots cannot be started. A failed or
    interrupted run is a result like any other: look at its `outcome`.
    """
    if runner not in get_args(Runner):
        expected = " or ".join(map(repr, get_args(Runner)))
        raise ScenarioError([f"runner: expected {expected}, got {runner!r}{did_you_mean(runner, get_args(Runner))}"])
    if seed < 0:
        raise ScenarioError([f"seed: expected >= 0, got {seed}"])
    if realtime is not None and not realtime >= REALTIME_MIN:
        raise ScenarioError([f"realtime: expected a factor of at least {REALTIME_MIN:g}, got {realtime}"])
    if isinstance(scenario, Scenario):
        if overrides:
            raise ScenarioError([f"overrides: a scenario that is already loaded takes none, got {list(overrides)}"])
    else:
        scenario = load(str(scenario), tuple(overrides))
    # A robot with a user of its own is not trusted: its code must not run as the user of the world.
    trusted = confinement.first_user is None
    with constructors_guarded():
        world, metrics = assemble_run(scenario, seed, import_controllers=trusted)
    members = node_specs(scenario, seed)
    watcher = watcher or NullProgress()
    if runner == "inline":
        if confinement != UNCONFINED:
            raise ScenarioError(["runner: only robots that are processes can be confined, got 'inline'"])
        refuse_forks()
        with constructors_guarded():
            nodes = {node: Node(controller, setup) for node, (controller, setup) in members.items()}
        watcher.joined(len(nodes), len(nodes))
        link = MemoryLink(
            {node: each.answer for node, each in nodes.items()},
            lambda node, incarnation: make_again(*restart_spec(scenario, seed, node, incarnation)).answer,
            world.schedule.late_joiners,
        )
        with hang_guard(scenario.time.straggler_s), _security(security_log, router=False) as security:
            guard = DenialGuard(security)
            return drive(world, link, seed, runner, realtime, watcher, record, link, metrics, guard)
    try_controllers(members, trusted)
    from zwerm.deploy.swarm import LocalSwarm  # not above: an inline run needs no transport

    with _security(security_log) as security:
        swarm = LocalSwarm(
            new_run_id(),
            members,
            progress=watcher.joined,
            paced=realtime is not None,
            late_joiners=world.schedule.late_joiners,
            restart=lambda node, incarnation: restart_spec(scenario, seed, node, incarnation),
            on_refusal=None if security is None else security.note,
            confinement=confinement,
        )
        with KeptResult(swarm.close) as kept, swarm:
            guard = DenialGuard(security, swarm.link.node_of_session)
            drive(world, swarm.link, seed, runner, realtime, watcher, record, swarm, metrics, guard, kept)
        return kept.end()


def _security(path: Path | None, router: bool = True) -> "AbstractContextManager[SecurityLog | None]":
    """Return the security log of a run, or nothing. It must be open before the router."""
    if path is None:
        return nullcontext()
    from zwerm.deploy.security_log import SecurityLog

    return SecurityLog(path, router)


def serve(
    scenario: Scenario,
    seed: int,
    listen: Sequence[str],
    credentials_file: Path | None = None,
    realtime: float | None = None,
    watcher: ProgressListener | None = None,
    record: Path | None = None,
    deadline_s: float = 600.0,
    *,
    keys_file: Path | None = None,
    names: Sequence[str] = (),
    lease_s: float = 10.0,
    plain: bool = False,
    security_log: Path | None = None,
) -> RunResult:
    """Run a world whose robots are started elsewhere, with the credentials that are written to `credentials_file`.

    Waits `deadline_s` for them to connect to one of the Zenoh endpoints `listen`. Raises ScenarioError and LinkError.
    """
    world, metrics = assemble_run(scenario, seed)
    if world.schedule.touches_programs:
        raise ScenarioError(
            [f"{scenario.place}: faults: robots that run elsewhere cannot be killed, started or paused"]
        )
    from zwerm.deploy.endpoints import check_encryption
    from zwerm.deploy.identity import load_world_keys
    from zwerm.deploy.swarm import RemoteSwarm

    if not plain:
        check_encryption(listen)
    if (credentials_file is None) == (keys_file is None):
        raise ScenarioError(["credentials: expected either a file to write them to, or the keys of a world"])

    watcher = watcher or NullProgress()
    with _security(security_log) as security:
        swarm = RemoteSwarm(
            new_run_id(),
            node_specs(scenario, seed),
            listen=listen,
            credentials_file=credentials_file,
            keys=None if keys_file is None else load_world_keys(keys_file),
            names=names,
            lease_s=lease_s,
            progress=watcher.joined,
            deadline_s=deadline_s,
            paced=realtime is not None,
            on_refusal=None if security is None else security.note,
        )
        with KeptResult(swarm.close) as kept, swarm:
            guard = DenialGuard(security, swarm.link.node_of_session)
            drive(world, swarm.link, seed, "remote", realtime, watcher, record, None, metrics, guard, kept)
        return kept.end()


def new_run_id() -> str:
    """Return a name for a run, unique among the runs of a router; it has no effect on results."""
    return secrets.token_hex(8)


def drive(
    world: World,
    link: WorldLink,
    seed: int,
    runner: str,
    realtime: float | None = None,
    watcher: ProgressListener | None = None,
    record: Path | None = None,
    programs: NodeProcesses | None = None,
    metrics: Observers | None = None,
    guard: DenialGuard | None = None,
    kept: KeptResult | None = None,
) -> RunResult:
    """Run `world` over a link on which all nodes have joined, and return the result; write a recording to `record`.

    `programs` carries out on nodes' programs what the scenario's faults demand. `metrics` measure the run; without them, new
    observers do, as the scenario asks. `kept` gets the result before the recording is closed: an interrupt may come then.
    """
    scenario = world.scenario
    if metrics is None:
        metrics = observers_of(scenario, world.scene.arena)
    sampling = Sampling(world, metrics, watcher or NullProgress())
    with ExitStack() as stack:
        observers: list[TickObserver] = []
        recording = None
        if record is not None:
            from zwerm.record.recording import Recording

            about = {"scenario": scenario.model_dump_json(exclude_defaults=True), "seed": str(seed), "runner": runner}
            recording = stack.enter_context(Recording(record, scenario.time.dt_s, about))
            world.telemetry.listeners.append(recording.telemetry)
            observers.append(ExchangeObserver(world, recording))
        observers.append(sampling)
        if guard is not None:
            stack.callback(guard.close)
            guard.note_refusals(world)
            observers.append(guard)
        driver = (
            LockStep(world, link, observers, programs)
            if realtime is None
            else RealTime(world, link, realtime, observers, programs)
        )
        start = time.monotonic()
        try:
            with _collecting_seldom():
                outcome, reason = driver.run(), driver.reason
        except StragglerError as error:
            outcome, reason = FAILED, str(error)
        except KeyboardInterrupt:
            outcome, reason = INTERRUPTED, f"interrupted at tick {world.tick}"
        wall_s = time.monotonic() - start
        sampling.finish()
        refusals = world.intake.refusals | link.refusals
        if guard is not None:
            refusals |= guard.refusals()
        result = _result(world, seed, runner, outcome, reason, wall_s, driver, sampling, refusals)
        if kept is not None:
            kept.result = result
        if recording is not None:
            recording.close()
            result.problems += [recording.error] if recording.error else []
        if guard is not None:
            result.problems += guard.problems
        return result


class Sampling:
    """Samples a run after every tick: its metrics, its history for pictures, and its progress."""

    def __init__(self, world: World, observers: Observers, watcher: ProgressListener) -> None:
        table = world.scenario.time
        self.observers = observers
        self.history = History()
        self._world = world
        self._watcher = watcher
        self._ticks = round(table.duration_s / table.dt_s)
        self._history_stride = max(1, self._ticks // HISTORY_SAMPLES)
        self._progress_stride = max(1, self._ticks // PROGRESS_REPORTS)
        self.history.append(world.scene, world.dead)
        self.observers.subscribe(world.telemetry)
        self.observers.sample(truth_of(world))

    def __call__(self, world: World) -> None:
        """Sample the tick that begins."""
        if self.observers.is_due(world.tick):
            self.observers.sample(truth_of(world))
            newest = self.observers.newest()
            if "coverage_fraction" in newest:
                self._watcher.covered(newest["coverage_fraction"], int(newest["robots_deployed"]))
        if world.tick % self._history_stride == 0:
            self.history.append(world.scene, world.dead)
        if world.tick % self._progress_stride == 0:
            self._watcher.ticked(world.tick, self._ticks)

    def finish(self) -> None:
        """Add the last scene to the history, if it is not there."""
        if self._world.tick % self._history_stride:
            self.history.append(self._world.scene, self._world.dead)


class ExchangeRecorder(Protocol):
    """Records the messages of every tick."""

    def exchange(
        self, tick: int, nodes: Sequence[int], observations: Sequence[bytes], answers: Sequence[bytes], scene: Scene
    ) -> None:
        """Record one tick: the observations sent to `nodes`, their answers (b"" for none), and the scene."""


class ExchangeObserver:
    """Gives the messages of every tick to a recorder, with the scene in which they were sent."""

    def __init__(self, world: World, recorder: ExchangeRecorder) -> None:
        self._recorder = recorder
        self._scene = world.scene

    def __call__(self, world: World) -> None:
        """Record the tick that has ended."""
        tick, nodes, observations, commands, _ = world.intake.exchange
        self._recorder.exchange(tick, nodes, observations, commands, self._scene)
        self._scene = world.scene


@contextmanager
def _collecting_seldom() -> Iterator[None]:
    """Let Python search for garbage cycles 100 times less often: messages form no cycles, and most objects are messages."""
    often, *rest = gc.get_threshold()
    gc.set_threshold(100 * often, *rest)
    try:
        yield
    finally:
        gc.set_threshold(often, *rest)


def _result(
    world: World,
    seed: int,
    runner: str,
    outcome: str,
    reason: str,
    wall_s: float,
    driver: LockStep | RealTime,
    sampling: Sampling,
    refusals: Refusals,
) -> RunResult:
    scenario, status, intake = world.scenario, world.status, world.intake
    metrics = measure(world, sampling.observers)
    metrics["refused_messages"] = float(intake.refusals.by_reason.total())
    if isinstance(driver, RealTime):
        metrics["late_commands"] = float(intake.late_count)
        metrics["deadman_stops"] = float(driver.deadman_stops)
        metrics["tick_overruns"] = float(driver.overruns)
    counts = None
    if scenario.metrics.cells is not None:
        position = world.scene.position[world.scene.present]
        counts = cell_counts(position, world.scene.arena.bounds, scenario.metrics.cells)
    return RunResult(
        scenario=scenario,
        seed=seed,
        runner=runner,
        outcome=outcome,
        reason=reason,
        trace=world.trace.hex(),
        ticks=world.tick,
        sim_s=round(world.scene.time_s, 9),
        wall_s=round(wall_s, 6),
        robots=scenario.robots.count,
        robot_ticks=intake.observed_count,
        metrics=metrics,
        radio=radio_report(world.medium, world.tick),
        middleware_lost=driver.lost,
        crashed=sorted({*status.crashed, *status.ever("crashed")}),
        restarted=sorted(status.ever("restarted")),
        hindered={event: sorted(status.ever(event)) for event in HINDRANCES},
        faults=[table.model_dump() for table in world.schedule.tables],
        missed_faults=[fault.in_words for fault in world.schedule.missed],
        arena=world.scene.arena,
        history=sampling.history,
        cell_counts=counts,
        refused=dict(refusals.by_reason),
        refused_by=refusals.by_node,
        series={name: np.array(values) for name, values in sampling.observers.series().items()},
        telemetry=world.telemetry.arrays(),
        snapshots=world.telemetry.snapshots,
        crash_reasons={node: f"tick {status.crash_ticks[node]}: {why}" for node, why in status.crashed.items()},
        tracebacks={node: failure.traceback for node, failure in status.failures.items() if failure.traceback},
    )
