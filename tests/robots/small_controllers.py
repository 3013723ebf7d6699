"""Controllers for tests of links and processes; robot processes find them through sys.path."""

from zwerm.agents.contract import Setup
from zwerm.protocol import BodyVelocity, Command, Observation, Transmission


class Echo:
    """Sends back what it hears."""

    def __init__(self, setup: Setup) -> None:
        pass

    def step(self, observation: Observation) -> Command:
        return Command(
            drive=BodyVelocity(0.1),
            outbox=tuple(Transmission(packet.channel, packet.payload) for packet in observation.inbox),
        )
