"""Whether it is over, as one robot lives it: the census is taken where the base asks for it, and answered everywhere else."""

from collections.abc import Collection
from typing import Final

import numpy as np

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.protocols.census import LIVES, Census, CensusMessage, CensusTally, Message

# Who lacks an answer asks so often, and a wave is begun so often [ticks].
POLL_TICKS: Final = 6
WAVE_TICKS: Final = 60


class CompletionProtocol:
    """One robot's part in the census."""

    def __init__(self, setup: Setup, random: np.random.Generator, base: bool = False) -> None:
        self._dt_s = setup.dt_s
        life = int(random.integers(LIVES))
        self._census = Census(setup.node, POLL_TICKS * setup.dt_s, WAVE_TICKS * setup.dt_s, life, base)
        self._sent: list[CensusMessage] = []
        self._noted: tuple[tuple[int, ...], int] | None = None
        self._tick = 0

    @property
    def concluded(self) -> bool:
        """Whether the base knows that all was quiet."""
        return self._census.concluded

    @property
    def last(self) -> CensusTally | None:
        """What the latest wave has counted."""
        return self._census.last

    def note(self, tick: int, neighbours: Collection[int], claims: int, busy: bool) -> None:
        """Take in whom the robot sees, how many frontiers it claims, and whether it has something to do; before it hears."""
        self._tick = tick
        noted = tuple(neighbours), claims
        if busy or claims or noted != self._noted:
            self._noted = noted
            self._census.note(noted[0], claims, busy)

    def hear(self, sender: int, message: Message) -> None:
        """Take in what another robot says of the census."""
        self._sent += self._census.hear(sender, message, self._tick * self._dt_s)

    def letters(self, asks: bool = True) -> list[CensusMessage]:
        """Return what is to be sent now, with whom it is for (None: all that hear it); the base begins waves if it `asks`."""
        if asks:
            self._sent += self._census.tick(self._tick * self._dt_s)
        sent, self._sent = self._sent, []
        return sent

    def next_tick(self) -> int | None:
        """Return when there is somebody to ask again."""
        return self._tick + POLL_TICKS if self._census.waits else None
