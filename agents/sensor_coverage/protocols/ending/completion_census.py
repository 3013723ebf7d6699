"""The census as a component: the base begins waves, and every robot answers them."""

from collections.abc import Callable, Collection, Iterable
from typing import ClassVar, Final

import numpy as np

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.messages.waves import CensusMessage, CensusTally, CensusWave
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.agents.sensor_coverage.protocols.ending.census import INCARNATIONS, Census

# Ticks between repeated questions of a robot, and between waves.
POLL_TICKS: Final = 6
WAVE_TICKS: Final = 60


class CompletionProtocol(Component):
    """One robot's part in the census. `asks` is true if the base may begin waves in this tick."""

    channel: ClassVar[str] = CHANNEL
    accepts: ClassVar[tuple[type, ...]] = (CensusWave, CensusTally)

    def __init__(
        self, setup: Setup, random: np.random.Generator, base: bool = False, asks: Callable[[], bool] = lambda: True
    ) -> None:
        self._dt_s = setup.dt_s
        incarnation = int(random.integers(INCARNATIONS))
        self._census = Census(setup.node, POLL_TICKS * setup.dt_s, WAVE_TICKS * setup.dt_s, incarnation, base)
        self._asks = asks
        self._outbox: list[Outgoing] = []
        self._updated: tuple[tuple[int, ...], int, tuple[int, ...], int] | None = None
        self._tick = 0

    @property
    def concluded(self) -> bool:
        """True if the base has concluded that all was quiet."""
        return self._census.concluded

    @property
    def last(self) -> CensusTally | None:
        """The tally of the latest wave that came back to the base."""
        return self._census.last

    @property
    def missing(self) -> tuple[int, ...]:
        """The robots that were let out, and that the latest tally has neither as present nor as dead."""
        return self._census.missing

    @property
    def wave(self) -> int:
        """The number of the latest wave."""
        return self._census.number

    @property
    def told_dead(self) -> tuple[int, ...]:
        """The robots that the latest wave says are dead."""
        return self._census.told_dead

    @property
    def search(self) -> int:
        """The number of times that all robots were to try again what had failed."""
        return self._census.search

    def begin_search(self) -> None:
        """At the base: have all robots try again what had failed, from the next wave on."""
        self._census.search += 1

    def let_out(self, robots: Iterable[int]) -> None:
        """Add robots to the roster of those that were let out."""
        self._census.let_out(robots)

    def restarted(self, node: int, tick: int) -> None:
        """Forget the answers of a neighbour's former incarnation."""
        self._census.restarted(node)

    def update(
        self,
        tick: int,
        neighbours: Collection[int],
        claims: int,
        busy: bool,
        dead: Collection[int] = (),
        unproven: int = 0,
    ) -> None:
        """Take in the visible robots, the number of frontier claims, and whether the robot is busy; first in every tick.

        `dead` are visible robots that are declared dead; they are not in `neighbours`. `unproven` counts the open arcs
        around this robot that no attempt has closed.
        """
        self._tick = tick
        updated = tuple(neighbours), claims, tuple(dead), unproven
        if busy or claims or updated != self._updated:
            self._updated = updated
            self._census.update(updated[0], claims, busy, dead, unproven)

    def receive(self, sender: int, message: CensusMessage, tick: int) -> None:
        """Take in a message of the census."""
        self._outbox += self._census.receive(sender, message, tick * self._dt_s)

    def is_idle(self, tick: int) -> bool:
        """Return whether no answer is missing."""
        return not self._census.waits

    def poll(self, tick: int) -> None:
        """Ask neighbours again that have not answered; at the base, begin a wave when it is due."""
        if self._asks():
            self._outbox += self._census.poll(self._tick * self._dt_s)

    def outgoing(self) -> list[Outgoing]:
        """Return the messages to send now."""
        sent, self._outbox = self._outbox, []
        return sent

    def next_wake(self) -> int | None:
        """Return the tick at which to ask again, if the robot waits for an answer."""
        return self._tick + POLL_TICKS if self._census.waits else None
