"""The task in Zwerm, inline: rigid bodies with contacts, walls, encoded messages and the trace."""

from collections.abc import Callable

from line_of_sight import main, side_m

from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.scenario.load import load
from zwerm.world.drivers.lockstep import LockStep


class Ticks(LockStep):
    """A driver that runs one tick at a time."""

    def tick(self) -> None:
        """Run one tick."""
        self._carry_out(self._world.begin())
        self._exchange()
        self._world.advance()


def make(robots: int) -> Callable[[], object]:
    """Return what runs one tick."""
    side = side_m(robots)
    settings = (f"robots.count={robots}", f"arena.size_m=[{side}, {side}]", 'robots.placement={kind="uniform"}')
    scenario = load("computation-free", settings)
    nodes = {node: Node(*spec).answer for node, spec in node_specs(scenario, 1).items()}
    return Ticks(assemble(scenario, 1), MemoryLink(nodes)).tick


if __name__ == "__main__":
    main(make)
