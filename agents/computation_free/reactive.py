"""The computation-free controller: one bit of line of sight selects one of two pairs of wheel speeds.

It has no memory and computes nothing; the open-loop and greedy controllers of the paper's comparison are other values of
the same four parameters.
"""

from typing import Annotated, Any, ClassVar

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ControllerError
from zwerm.wire.messages import Command, Observation, WheelSpeeds

Speed = Annotated[float, Meta(ge=-1.0, le=1.0)]


class WheelTable(Struct, frozen=True, forbid_unknown_fields=True):
    """Normalised wheel speeds (v_l,0, v_r,0, v_l,1, v_r,1); the best evolved ones by default. Ozdemir 2019, section III-D."""

    left_0: Speed = 0.719558
    right_0: Speed = 0.412543
    left_1: Speed = -0.998071
    right_1: Speed = -0.911843


def wheel_fractions(wheels: WheelTable) -> tuple[float, float, float, float]:
    """Return left and right wheel speed as fractions of the greatest: without a robot in sight, and with one."""
    return wheels.left_0, wheels.right_0, wheels.left_1, wheels.right_1


class ComputationFree(Controller):
    """(v_l, v_r) = (v_l,0, v_r,0) if s = 0, (v_l,1, v_r,1) otherwise. Ozdemir 2019, eq. 1."""

    sensors: ClassVar[tuple[str, ...]] = ("line_of_sight",)
    Parameters: ClassVar[type[Struct]] = WheelTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        wheels: Any = self.parameters
        if setup.body is None:
            raise ControllerError("computation-free: needs a body with wheels")
        speed = setup.body.max_speed_m_s
        self._alone = Command(drive=WheelSpeeds(wheels.left_0 * speed, wheels.right_0 * speed))
        self._sighted = Command(drive=WheelSpeeds(wheels.left_1 * speed, wheels.right_1 * speed))

    def step(self, observation: Observation) -> Command:
        """Return the command that belongs to the sensor's bit."""
        return self._sighted if observation.line_of_sight else self._alone
