"""Bodies and drives of robots. A drive is a plug-in of one file and one row, or a user's own `module:Class`."""

from abc import ABC, abstractmethod
from typing import ClassVar

from zwerm.scenario.tables import BodyTable
from zwerm.wire.messages import BodyVelocity, WheelSpeeds
from zwerm.world.scene import Floats

Velocities = tuple[Floats, Floats | None, Floats]


class Drive(ABC):
    """The kinematics of a kind of body: the base class of the plug-in kind `drive`.

    `command` is the type of drive that a controller commands. With `has_wheels` the robot's Setup has its wheel base.
    `memoryless` states that each row of `velocities` depends on the same row of its argument only. It is then computed for the
    robots whose command has changed, and for no others.
    """

    command: ClassVar[type[BodyVelocity] | type[WheelSpeeds]]
    has_wheels: ClassVar[bool] = False
    memoryless: ClassVar[bool] = False

    def __init__(self, body: BodyTable) -> None:
        self.body = body

    @abstractmethod
    def velocities(self, commanded: Floats) -> Velocities:
        """Return (forward [m/s], left [m/s] or None, turn [rad/s]), each (n,), within the limits of the motors.

        `commanded` (n, axes) holds the fields of `command`, in their order.
        """
