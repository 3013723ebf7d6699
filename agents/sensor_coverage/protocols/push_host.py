"""What a push needs of the robot that is part of it."""

from typing import Protocol

from zwerm.agents.sensor_coverage.messages.commands import Correct, Deploy, Move
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap
from zwerm.agents.sensor_coverage.protocols.mailbox import ReliableMailbox

Drive = Deploy | Move | Correct


class PushHost(Protocol):
    """The robot that a push is part of."""

    tick: int
    post: ReliableMailbox
    vicinity: LocalMap

    @property
    def node(self) -> int:
        """Its id."""

    @property
    def clear(self) -> bool:
        """Whether it stands, has looked around, and nobody about it is on the way."""

    @property
    def bearings(self) -> dict[int, float]:
        """Whom it sees now."""

    def drive(self, order: Drive) -> None:
        """Begin a drive."""

    def rest(self) -> None:
        """Say that the drive is over: it stands, for neighbours to look at."""

    def tell_gone(self, push: int) -> None:
        """Broadcast that this leader is gone."""
