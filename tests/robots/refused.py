"""Controllers whose commands the world refuses, each for one rule, and one whose numbers are NumPy's."""

from typing import Any

import numpy as np

from zwerm.agents.runtime.contract import Controller
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission, Wake, WheelSpeeds

NAN = float("nan")


class _Good(Controller):
    """Drives, but for robot 1 at tick 3, which answers what `wrong` returns."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 1 and observation.tick == 3:
            return self.wrong()
        return Command(drive=WheelSpeeds(0.1, 0.1))

    def wrong(self) -> Any:
        raise NotImplementedError


class WrongDrive(_Good):
    def wrong(self) -> Any:
        return Command(drive=BodyVelocity(0.25))


class NotANumber(_Good):
    def wrong(self) -> Any:
        return Command(drive=WheelSpeeds(NAN, 0.0))


class TextForBytes(_Good):
    def wrong(self) -> Any:
        return Command(outbox=(Transmission("robots", "hello"),))  # type: ignore[arg-type]


class NoRadio(_Good):
    def wrong(self) -> Any:
        return Command(outbox=(Transmission("robots", b"hello"),))


class Nothing(_Good):
    def wrong(self) -> Any:
        return None


class NoSuchType(_Good):
    def wrong(self) -> Any:
        return Command(drive=WheelSpeeds({1}, 0.0))  # type: ignore[arg-type]


class Numpy(Controller):
    """Commands with NumPy scalars: the same numbers as plain ones."""

    def step(self, observation: Observation) -> Command:
        return Command(
            drive=WheelSpeeds(np.float64(0.1), np.float32(0.5)),  # type: ignore[arg-type]
            wake=Wake(at_s=np.float64(observation.time_s)),
        )


class Plain(Controller):
    """The same commands with plain numbers."""

    def step(self, observation: Observation) -> Command:
        return Command(drive=WheelSpeeds(0.1, 0.5), wake=Wake(at_s=observation.time_s))


class Sideways(Controller):
    """Always commands the drive of another body."""

    def step(self, observation: Observation) -> Command:
        return Command(drive=BodyVelocity(0.1))


class Talks(Controller):
    """Always sends, with a radio or without."""

    def step(self, observation: Observation) -> Command:
        return Command(outbox=(Transmission("robots", b"x"),))
