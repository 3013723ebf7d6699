"""Controllers that break the contract, each in one way; a new interpreter can import them."""

from zwerm.agents.runtime.contract import Controller
from zwerm.wire.messages import Command, Observation, WheelSpeeds


class OrderOfASet(Controller):
    """Its command depends on the order of iteration over a set of strings."""

    def step(self, observation: Observation) -> Command:
        order = "".join({"1", "2", "3", "4", "5", "6", "7", "8"})
        return Command(drive=WheelSpeeds(1e-9 * int(order), 0.0))


class HashOfAName(Controller):
    """Its command depends on the hash of a string."""

    def step(self, observation: Observation) -> Command:
        return Command(drive=WheelSpeeds(0.01 * (hash("name") % 97), 0.0))


class OrderOfASortedSet(Controller):
    """Sorts the set first, and so keeps the contract."""

    def step(self, observation: Observation) -> Command:
        order = "".join(sorted({"1", "2", "3", "4", "5", "6", "7", "8"}))
        return Command(drive=WheelSpeeds(1e-9 * int(order), 0.0))
