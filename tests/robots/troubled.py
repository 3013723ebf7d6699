"""Controllers with defects, for tests of the emulator's reaction."""

import os
import signal
import time

from zwerm.agents.runtime.contract import Controller
from zwerm.wire.messages import Command, Observation, Transmission, Wake, WheelSpeeds


class Raises(Controller):
    """Robot 2 divides by zero at tick 5; the others drive on."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 2 and observation.tick == 5:
            _ = 1 / 0
        return Command(drive=WheelSpeeds(0.1, 0.1))


class Dies(Controller):
    """Robot 2 is killed by signal 9 at tick 5."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 2 and observation.tick == 5:
            os.kill(os.getpid(), signal.SIGKILL)
        return Command(drive=WheelSpeeds(0.1, 0.1))


class Hangs(Controller):
    """Robot 1 never answers the observation of tick 3."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 1 and observation.tick == 3:
            signal.pause()
        return Command()


class Slow(Controller):
    """Robot 1 takes half a second of wall-clock time over its fifth answer; the others are quick."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 1 and observation.tick == 5:
            time.sleep(0.5)
        return Command(drive=WheelSpeeds(0.1, 0.1))


class Chatter(Controller):
    """Every robot sends its random number to all, adds the received numbers to its speed, and sleeps a little every
    tenth tick."""

    def __init__(self, setup):
        super().__init__(setup)
        self.received = 0.0

    def step(self, observation: Observation) -> Command:
        for packet in observation.inbox:
            self.received = (self.received + float(packet.payload.decode())) % 1.0
        number = self.random.random()
        wake = (
            Wake(at_s=observation.time_s + 0.5, on_packet=self.setup.node % 2 == 0)
            if observation.tick % 10 == 9
            else None
        )
        return Command(
            drive=WheelSpeeds(0.1 * self.received, 0.1 * number),
            outbox=(Transmission("robots", repr(number).encode()),) if observation.tick % 3 == 0 else (),
            wake=wake,
        )


class Finishes(Controller):
    """Reports that it is done after as many ticks as its id."""

    def step(self, observation: Observation) -> Command:
        return Command(done=observation.tick >= self.setup.node)
