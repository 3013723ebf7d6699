"""Controllers that report telemetry, correct and forged."""

from typing import ClassVar

import numpy as np

from zwerm.agents.runtime.contract import Controller
from zwerm.wire.messages import Command, Observation, WheelSpeeds

DRIVE = WheelSpeeds(0.1, 0.05)


class Silent(Controller):
    """Drives, and reports nothing."""

    def step(self, observation: Observation) -> Command:
        return Command(drive=DRIVE)


class Reports(Controller):
    """Drives like `Silent`, and reports its tick, its id, and a snapshot, as all kinds of numbers."""

    def step(self, observation: Observation) -> Command:
        numbers = {
            "tick": np.int64(observation.tick),
            "node": self.setup.node,
            "half": np.float32(0.5),
            "even": observation.tick % 2 == 0,
        }
        return Command(drive=DRIVE, telemetry=numbers, snapshot=b"\x01" * 8)  # type: ignore[arg-type]


class Forges(Controller):
    """Reports numbers by the names of the world's own metrics."""

    def step(self, observation: Observation) -> Command:
        names = ("robots_in_arena", "cell_coverage_fraction", "deployment_cycles", "refused_messages")
        return Command(drive=DRIVE, telemetry=dict.fromkeys(names, 1e6))


class Misreports(Controller):
    """Robot 1 reports at tick 3 what is no telemetry, of the `kind` of the class; the others drive on."""

    values: ClassVar[dict[str, dict[str, object]]] = {
        "table": {"complex": {}},
        "text": {"x": "many"},
        "nan": {"x": float("nan")},
        "name": {"X y": 1.0},
    }

    def step(self, observation: Observation) -> Command:
        command = Command(drive=DRIVE)
        if self.setup.node == 1 and observation.tick == 3:
            command.telemetry = self.values[self.kind]  # type: ignore[assignment]
        return command

    kind = "table"


class MisreportsText(Misreports):
    """The same with text."""

    kind = "text"


class MisreportsNan(Misreports):
    """The same with a number that is not finite."""

    kind = "nan"


class MisreportsName(Misreports):
    """The same with a name that is none."""

    kind = "name"


class Floods(Controller):
    """Reports 64 numbers and a large snapshot at every tick."""

    def step(self, observation: Observation) -> Command:
        numbers = {f"n_{index}": float(observation.tick) for index in range(64)}
        return Command(drive=DRIVE, telemetry=numbers, snapshot=bytes(10_000))
