"""Small halls for sensor coverage, and a function that runs one step by step for a test."""

from collections.abc import Callable

from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.scenario.tables import Scenario
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.world import World

HALL = ("arena.size_m=[3.4,2.8]", "base.pose=[0.2,1.4,0.0]", "robots.count=40")
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
