"""Controllers for tests of faults: their messages show the effects of faults on them."""

from zlib import crc32

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission, Wake, WheelSpeeds


class Counts(Controller):
    """Drives on, and broadcasts the number of its observations, and a random number of its own."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.steps = 0

    def step(self, observation: Observation) -> Command:
        self.steps += 1
        word = f"{self.setup.node} {self.steps} {self.random.random():.6f}".encode()
        return Command(
            drive=BodyVelocity(0.01) if self.setup.body else None,
            outbox=tuple([Transmission(channel, word) for channel in self.setup.channels]),
        )


class Raises(Controller):
    """Divides by zero at its third observation."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.steps = 0

    def step(self, observation: Observation) -> Command:
        self.steps += 1
        if self.setup.node == 1 and self.steps == 3:
            raise ZeroDivisionError
        return Command()


class Babbles(Controller):
    """Sends and drives as a function of all that it receives, senses and draws; sleeps at some ticks."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.sum = setup.node

    def step(self, observation: Observation) -> Command:
        seen = repr((observation.bearings, observation.touch, observation.line_of_sight)).encode()
        for payload in (*(packet.payload for packet in observation.inbox), seen):
            self.sum = crc32(payload, self.sum)
        number = self.random.random()
        word = f"{self.sum} {number}".encode()
        share = self.sum / 2**32
        return Command(
            drive=WheelSpeeds(0.1 * share, 0.1 * number) if self.setup.body else None,
            outbox=tuple([Transmission(channel, word) for channel in self.setup.channels]),
            wake=Wake(at_s=observation.time_s + 0.4, on_packet=self.sum % 2 == 0) if self.sum % 5 == 0 else None,
        )
