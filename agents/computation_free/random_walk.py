"""The correlated random walk that the computation-free swarm is compared with (Dimidov, Oriolo, Trianni 2016).

Straight segments at full speed alternate with turns on the spot at full speed. Turning angles are wrapped Cauchy about 0
with correlation rho; lengths are the magnitude of a symmetric alpha-stable variable with scale beta.
"""

import math
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ControllerError
from zwerm.wire.messages import Command, Observation, WheelSpeeds


class WalkTable(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the walk. Ozdemir et al. optimised theirs but did not publish them; these are our own."""

    rho: Annotated[float, Meta(gt=0.0, lt=1.0)] = 0.41
    alpha: Annotated[float, Meta(gt=0.0, le=2.0)] = 1.67
    beta_m: Annotated[float, Meta(gt=0.0)] = 0.156


def wrapped_cauchy(random: np.random.Generator, rho: float) -> float:
    """Return an angle [rad] in (-pi, pi) from the wrapped Cauchy distribution with mean 0 and mean resultant length rho."""
    return 2.0 * math.atan((1.0 - rho) / (1.0 + rho) * math.tan(math.pi * (random.random() - 0.5)))


def symmetric_stable(random: np.random.Generator, alpha: float, scale: float) -> float:
    """Return a symmetric alpha-stable variate (Chambers, Mallows, Stuck 1976); alpha = 2 is Gaussian, 1 is Cauchy."""
    angle = math.pi * (random.random() - 0.5)
    # A draw of exactly 0 has no logarithm; the next smallest draw is 2^-53.
    wait = max(-math.log(1.0 - random.random()), 2.0**-54)
    if alpha == 1.0:
        return scale * math.tan(angle)
    stretch = math.sin(alpha * angle) / math.pow(math.cos(angle), 1.0 / alpha)
    return scale * stretch * math.pow(math.cos((1.0 - alpha) * angle) / wait, (1.0 - alpha) / alpha)


class RandomWalk(Controller):
    """Walk a segment, turn on the spot, walk the next; both last a whole number of control cycles."""

    Parameters: ClassVar[type[Struct]] = WalkTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        if setup.body is None or setup.body.wheel_base_m <= 0.0:
            raise ControllerError("random-walk: needs a body with wheels")
        speed = setup.body.max_speed_m_s
        self._step_m = speed * setup.dt_s
        self._turn_rad = 2.0 * speed / setup.body.wheel_base_m * setup.dt_s
        self._forward = Command(drive=WheelSpeeds(speed, speed))
        self._spin = {1: Command(drive=WheelSpeeds(-speed, speed)), -1: Command(drive=WheelSpeeds(speed, -speed))}
        self._walking = 0
        self._turning = 0
        self._side = 1

    def step(self, observation: Observation) -> Command:
        """Return the command of the current segment or turn, and draw the next pair when both are used up."""
        while self._turning == 0 and self._walking == 0:
            self._draw()
        if self._turning:
            self._turning -= 1
            return self._spin[self._side]
        self._walking -= 1
        return self._forward

    def _draw(self) -> None:
        walk: Any = self.parameters
        angle = wrapped_cauchy(self.random, walk.rho)
        length = abs(symmetric_stable(self.random, walk.alpha, walk.beta_m))
        self._side = 1 if angle >= 0.0 else -1
        self._turning = round(abs(angle) / self._turn_rad)
        self._walking = round(min(length / self._step_m, 1e9))
