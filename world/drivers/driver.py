"""The order of one tick, the same for every driver.

A driver decides how long it waits for answers and how programs are started and stopped. The world decides everything
else, and the end of the run, too.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

from zwerm.link import NodeProcesses, WorldLink
from zwerm.world.tick.node_status import ProcessAction
from zwerm.world.world import World

TickObserver = Callable[[World], object]


class Driver(ABC):
    """Drives a world over a link. Every one of `observers` is called with the world once a tick has ended.

    `reason` says why a run failed.
    """

    def __init__(
        self,
        world: World,
        link: WorldLink,
        observers: Sequence[TickObserver] = (),
        programs: NodeProcesses | None = None,
    ) -> None:
        self._world = world
        self._link = link
        self._observers = tuple(observers)
        self._programs = programs
        self._evicted = False  # whether a node was evicted since this was last set to false
        world.on_flood = self._stop_flood
        self.reason = ""

    def run(self) -> str:
        """Drive until the run ends, and return its outcome."""
        world = self._world
        while (ending := world.ending()) is None:
            self._carry_out(world.begin())
            self._exchange()
            if world.ending(within_tick=True) is None:
                world.advance()
                for observe in self._observers:
                    observe(world)
        self.reason = ending.reason
        return ending.outcome

    def _stop_flood(self, node: int) -> None:
        """Drop all further messages of a node on arrival, and end its program if it runs on this machine."""
        self._evicted = True
        self._link.evict(node)
        if self._programs is not None:
            self._programs.kill(node)

    def _lose(self, node: int, wait_s: float) -> None:
        """Inform the world that a node is lost, and how its program ended if that is known within `wait_s`."""
        known = self._programs is not None and self._programs.end_of(node, wait_s)
        self._world.crash(node, known or "the connection to it was lost")

    @property
    @abstractmethod
    def lost(self) -> int:
        """Number of observations that living nodes have not answered."""

    @abstractmethod
    def _carry_out(self, actions: Sequence[ProcessAction]) -> None:
        """Carry out the actions of this tick on the nodes' programs."""

    @abstractmethod
    def _exchange(self) -> None:
        """Send the observations of this tick, and take the answers."""
