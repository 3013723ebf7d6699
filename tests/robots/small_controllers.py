"""Controllers for tests of links and processes; robot processes find them through sys.path."""

import asyncio
import time

from zwerm.agents.runtime.contract import Setup
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission


class Echo:
    """Sends back each payload that it receives."""

    def __init__(self, setup: Setup) -> None:
        pass

    def step(self, observation: Observation) -> Command:
        return Command(
            drive=BodyVelocity(0.1),
            outbox=tuple(Transmission(packet.channel, packet.payload) for packet in observation.inbox),
        )


class Spins:
    """Never answers, and never comes back."""

    def __init__(self, setup: Setup) -> None:
        pass

    def step(self, observation: Observation) -> Command:
        while True:
            pass


class Exits(Echo):
    """Ends its process, which no controller may."""

    def step(self, observation: Observation) -> Command:
        raise SystemExit(0)


class Cancels(Echo):
    """Fails with what is no Exception and ends no process."""

    def step(self, observation: Observation) -> Command:
        raise asyncio.CancelledError("not mine to raise")


class Wordy(Echo):
    """Fails with a message longer than one packet of the transport."""

    def step(self, observation: Observation) -> Command:
        raise ValueError("x" * 60_000 + "\u2620")


class Recurses(Echo):
    """Calls itself without end."""

    def step(self, observation: Observation) -> Command:
        return self.step(observation)


class Garrulous(Echo):
    """Sends more than a message can hold."""

    def step(self, observation: Observation) -> Command:
        return Command(outbox=(Transmission("a", bytes(100_000)),))


class Unspeakable(Echo):
    """Fails with an error text that is no valid Unicode."""

    def step(self, observation: Observation) -> Command:
        raise ValueError("\udcff")


class NeverMade(Echo):
    """Cannot be made: its process waits for as long as it lives."""

    def __init__(self, setup: Setup) -> None:
        time.sleep(3_600.0)
