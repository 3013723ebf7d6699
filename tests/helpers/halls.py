"""Small halls and drawn buildings for sensor coverage, and functions that run them for a test."""

from collections.abc import Callable

from benchmarks.common.small_buildings import small_building
from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.run.progress import ProgressListener
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.scenario.tables import Scenario
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.world import World

HALL = ("arena.size_m=[3.4,2.8]", "base.pose=[0.2,1.4,0.0]", "robots.count=40")
EXACT = "robots.sensors.0.sd_rad=0.0"
NOISE = "robots.sensors.0.sd_rad=0.0436332"
OBSTACLE = "arena.obstacles=[[[1.5,1.0],[2.3,1.0],[2.3,1.8],[1.5,1.8]]]"

Link = Callable[[bytes], bytes]


def drive(
    scenario: Scenario,
    on_tick: Callable[[World], None] | None = None,
    around: Callable[[int, Link], Link] | None = None,
) -> tuple[str, World]:
    """Run inline; `on_tick` may change the world, `around` the messages from and to a node."""
    world = assemble(scenario, 1)
    answers: dict[int, Link] = {n: Node(*each).answer for n, each in node_specs(scenario, 1).items()}
    if around is not None:
        answers = {n: around(n, each) for n, each in answers.items()}
    driver = LockStep(world, MemoryLink(answers), [] if on_tick is None else [on_tick])
    outcome = driver.run()
    return outcome, world


def carry_out(
    seed: int, dies: bool, more: tuple[str, ...], watcher: ProgressListener | None = None, run_seed: int | None = None
) -> RunResult:
    """Run a small building with a narrow opening. Longer runs belong to `benchmarks/algorithms/bench_openings.py`.

    `run_seed` is the seed of the run, that of the building if it is None.
    """
    building = small_building(seed)
    settings = (
        *building.settings(),
        *((building.death(),) if dies else ()),
        "robots.count=30",
        "time.duration_s=1000.0",
    )
    run_seed = seed if run_seed is None else run_seed
    return run("sensor-coverage-narrow", run_seed, "inline", (*settings, *more), watcher=watcher)
