"""Faults of a user, for tests."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import Fraction, Rectangle
from zwerm.world.arena.arena import Arena
from zwerm.world.faults import Fault, FaultContext, FaultTable, ProgramStates
from zwerm.world.radio import PacketJudge, Packets, Transmissions, Verdict
from zwerm.world.scene import Bools, Ints, Scene
from zwerm.world.sensors import Sensor


class FloodTable(FaultTable):
    """The area that is under water [m]."""

    area_m: Rectangle


class Flood(Fault):
    """Robots in an area receive no packets, their cameras are dark, and their programs are slow everywhere."""

    Parameters: ClassVar[type[FaultTable]] = FloodTable
    alters_sensors: ClassVar[bool] = True
    in_network: ClassVar[bool] = True
    cause: ClassVar[str] = "flood"
    out_of_reach: ClassVar[bool] = False

    def wet(self, scene: Scene) -> Bools:
        xmin, ymin, xmax, ymax = self.parameters.area_m
        x, y = scene.position.T
        inside: Bools = (xmin <= x) & (x <= xmax) & (ymin <= y) & (y <= ymax)
        return inside

    def on_programs(self, states: ProgramStates) -> None:
        states.every_ticks[:] = np.maximum(states.every_ticks, 2)

    def on_radio(self, channel: str) -> Sequence[PacketJudge]:
        return (self,) if channel == "robots" else ()

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        return Verdict(self.wet(sent.scene)[packets.receiver])

    def alters(self, sensor: Sensor) -> bool:
        return sensor.dark is not None

    def alter(self, sensor: Sensor, readings: list[Any], scene: Scene, robots: Ints) -> None:
        for row in np.flatnonzero(self.wet(scene)[robots]).tolist():
            readings[row] = sensor.dark

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any]:
        xmin, ymin, xmax, ymax = arena.bounds
        return {"area_m": [xmin, ymin, float(stream.uniform(xmin, xmax)) + 0.01, ymax]}

    @classmethod
    def impossible(cls, scenario: Scenario) -> str:
        return "" if scenario.radio is not None else "the scenario has no radio"


class StaticTable(FaultTable):
    """The fraction of packets that are lost."""

    fraction: Fraction


class Static:
    """Loses packets at random. It does not inherit from the base class of faults."""

    Parameters: ClassVar[type[FaultTable]] = StaticTable
    cause: ClassVar[str] = "static"
    out_of_reach: ClassVar[bool] = False

    def __init__(self, parameters: StaticTable, context: FaultContext) -> None:
        self._fraction = parameters.fraction
        self._purpose = context.purpose

    @classmethod
    def check(cls, parameters: StaticTable, scenario: Scenario) -> list[str]:
        return [".fraction: expected > 0, got 0"] if parameters.fraction == 0.0 else []

    def on_radio(self, channel: str) -> Sequence[PacketJudge]:
        return (self,)

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        number = sent.scene.draws.uniform(self._purpose, sent.tick, packets.sender, packets.receiver)
        return Verdict(number < self._fraction)


class WithoutTable(Static):
    """No fault: its parameters are no table of a fault."""

    Parameters = dict  # type: ignore[assignment]
