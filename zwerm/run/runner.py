"""Running a scenario: inline in this process, or with every robot a process of its own."""

import gc
import secrets
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs, restart_spec
from zwerm.errors import ScenarioError, StragglerError
from zwerm.link import NodeProcesses, WorldLink
from zwerm.link.memory import MemoryLink
from zwerm.record.history import History
from zwerm.run.assembly import assemble
from zwerm.run.measurement import measure, truth_of
from zwerm.run.result import RunResult
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.world.drivers.lockstep import FAILED, INTERRUPTED, LockStep
from zwerm.world.drivers.realtime import RealTime
from zwerm.world.metrics.coverage import cell_counts
from zwerm.world.radio.report import radio_report
from zwerm.world.world import World

Runner = Literal["processes", "inline"]

# How many samples of a run its history takes, for pictures and animations, and how often a watcher is told of ticks.
HISTORY_SAMPLES = 4_000
TOLD_TIMES = 1_000


class ProgressListener(Protocol):
    """Somebody to tell how a run is getting on."""

    def joined(self, count: int, total: int) -> None:
        """`count` of `total` robots have joined."""

    def ticked(self, tick: int, ticks: int) -> None:
        """`tick` of `ticks` are done."""

    def covered(self, fraction: float, robots: int) -> None:
        """This fraction of the arena is in sight of so many robots."""


class NullProgress:
    """A watcher that does not look."""

    def joined(self, count: int, total: int) -> None:
        """Ignore it."""

    def ticked(self, tick: int, ticks: int) -> None:
        """Ignore it."""

    def covered(self, fraction: float, robots: int) -> None:
        """Ignore it."""


def run(
    scenario: str | Path | Scenario,
    seed: int = 1,
    runner: Runner = "processes",
    overrides: Sequence[str] = (),
    realtime: float | None = None,
    watcher: ProgressListener | None = None,
    record: Path | None = None,
) -> RunResult:
    """Run `scenario` (a built-in name, a path, or one already loaded) and return its result.

    `overrides` are `path=value` strings; `realtime` paces the run at that factor of the wall clock; `record` is a file
    to write an MCAP recording to. Raises ScenarioError for a mistake in the scenario, and LinkError where robots cannot
    be started. A failed or interrupted run is a result like any other: look at its `outcome`.
    """
    if seed < 0:
        raise ScenarioError([f"seed: expected >= 0, got {seed}"])
    if realtime is not None and not realtime > 0:
        raise ScenarioError([f"realtime: expected a factor > 0, got {realtime}"])
    if isinstance(scenario, Scenario):
        if overrides:
            raise ScenarioError([f"overrides: a scenario that is already loaded takes none, got {list(overrides)}"])
    else:
        scenario = load(str(scenario), tuple(overrides))
    world = assemble(scenario, seed)
    members = node_specs(scenario, seed)
    watcher = watcher or NullProgress()
    if runner == "inline":
        nodes = {node: Node(controller, setup) for node, (controller, setup) in members.items()}
        watcher.joined(len(nodes), len(nodes))
        link = MemoryLink(
            {node: each.answer for node, each in nodes.items()},
            lambda node, incarnation: Node(*restart_spec(scenario, seed, node, incarnation)).answer,
            world.schedule.late_joiners,
        )
        return drive(world, link, seed, runner, realtime, watcher, record, link)
    from zwerm.deploy.swarm import LocalSwarm  # not above: an inline run needs no transport

    with LocalSwarm(
        new_run_id(),
        members,
        progress=watcher.joined,
        paced=realtime is not None,
        late_joiners=world.schedule.late_joiners,
        restart=lambda node, incarnation: restart_spec(scenario, seed, node, incarnation),
    ) as swarm:
        return drive(world, swarm.link, seed, runner, realtime, watcher, record, swarm)


def serve(
    scenario: Scenario,
    seed: int,
    listen: Sequence[str],
    credentials_file: Path,
    realtime: float | None = None,
    watcher: ProgressListener | None = None,
    record: Path | None = None,
    deadline_s: float = 600.0,
) -> RunResult:
    """Run a world whose robots are started elsewhere, with the credentials that are written to `credentials_file`.

    Waits `deadline_s` for them to connect to one of the Zenoh endpoints `listen`. Raises ScenarioError and LinkError.
    """
    world = assemble(scenario, seed)
    if world.schedule.touches_programs:
        raise ScenarioError(
            [f"{scenario.place}: faults: robots that run elsewhere cannot be killed, started or paused"]
        )
    from zwerm.deploy.swarm import RemoteSwarm

    watcher = watcher or NullProgress()
    with RemoteSwarm(
        new_run_id(),
        node_specs(scenario, seed),
        listen=listen,
        credentials_file=credentials_file,
        progress=watcher.joined,
        deadline_s=deadline_s,
        paced=realtime is not None,
    ) as swarm:
        return drive(world, swarm.link, seed, "remote", realtime, watcher, record)


def new_run_id() -> str:
    """Return a name for a run that no other run on the same router has; it influences nothing."""
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
) -> RunResult:
    """Run `world` over a link on which all nodes have joined, and return the result; write a recording to `record`.

    `programs` does to nodes what the scenario's faults demand.
    """
    if record is None:
        return _drive(world, link, seed, runner, realtime, watcher or NullProgress(), programs)
    from zwerm.record.recording import Recording

    about = {"scenario": world.scenario.model_dump_json(exclude_defaults=True), "seed": str(seed), "runner": runner}
    with Recording(record, world.scenario.time.dt_s, about) as recording:
        world.recording = recording
        world.telemetry.listeners.append(recording.telemetry)
        return _drive(world, link, seed, runner, realtime, watcher or NullProgress(), programs)


def _drive(
    world: World,
    link: WorldLink,
    seed: int,
    runner: str,
    realtime: float | None,
    watcher: ProgressListener,
    programs: NodeProcesses | None,
) -> RunResult:
    table = world.scenario.time
    ticks = round(table.duration_s / table.dt_s)
    stride, telling = max(1, ticks // HISTORY_SAMPLES), max(1, ticks // TOLD_TIMES)
    history = History()
    history.append(world.scene, world.dead)
    world.observers.sample(truth_of(world))

    def on_tick(world: World) -> None:
        if world.observers.is_due(world.tick):
            world.observers.sample(truth_of(world))
            newest = world.observers.newest()
            if "coverage_fraction" in newest:
                watcher.covered(newest["coverage_fraction"], int(newest["robots_deployed"]))
        if world.tick % stride == 0:
            history.append(world.scene, world.dead)
        if world.tick % telling == 0:
            watcher.ticked(world.tick, ticks)

    driver = (
        LockStep(world, link, on_tick, programs)
        if realtime is None
        else RealTime(world, link, realtime, on_tick, programs)
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
    if world.tick % stride:
        history.append(world.scene, world.dead)
    return _result(world, seed, runner, outcome, reason, wall_s, driver, history, link)


@contextmanager
def _collecting_seldom() -> Iterator[None]:
    """Let Python look for cycles of garbage a hundred times less often: messages are part of none, and make up most objects."""
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
    history: History,
    link: WorldLink,
) -> RunResult:
    scenario = world.scenario
    metrics = measure(world)
    metrics["refused_messages"] = float(world.refused.total())
    if isinstance(driver, RealTime):
        metrics["late_commands"] = float(world.answers.late_count)
        metrics["deadman_stops"] = float(driver.deadman_stops)
        metrics["tick_overruns"] = float(driver.overruns)
    counts = None
    if scenario.metrics.cells is not None:
        position = world.scene.position[world.scene.present]
        counts = cell_counts(position, world.arena.bounds, scenario.metrics.cells)
    return RunResult(
        scenario=scenario,
        seed=seed,
        runner=runner,
        outcome=outcome,
        reason=reason,
        trace=world.trace.hex(),
        ticks=world.tick,
        sim_s=round(world.time_s, 9),
        wall_s=round(wall_s, 6),
        robots=world.count,
        robot_ticks=world.robot_ticks,
        metrics=metrics,
        radio=radio_report(world.medium, world.tick),
        middleware_lost=driver.lost,
        crashed=sorted({*world.crashed, *world.lives.ever.get("crashed", ())}),
        restarted=sorted(world.lives.ever.get("restarted", ())),
        hindered={what: sorted(world.lives.ever.get(what, ())) for what in ("paused", "slow", "late")},
        faults=[table.model_dump() for _, table in world.fault_tables],
        missed_faults=[fault.in_words for fault in world.schedule.missed],
        arena=world.arena,
        history=history,
        cell_counts=counts,
        refused=dict(world.refused + Counter(getattr(link, "refused", {}))),
        series={name: np.array(values) for name, values in world.observers.series().items()},
        telemetry=world.telemetry.arrays(),
        snapshots=world.telemetry.snapshots,
        tracebacks={node: failure.traceback for node, failure in world.failures.items()},
    )
