"""What nodes tell those who watch a run: numbers of their own, pictures of their minds, and that they give up.

Nobody in the run hears any of it.
"""

from typing import Any, NamedTuple

from zwerm.wire.messages import Command
from zwerm.world.scene import Bools, Floats, Scene


class TelemetryRecord(NamedTuple):
    """What a node told, and where the robots were then."""

    tick: int
    time_s: float
    node: int
    told: dict[str, Any]
    position: Floats  # (n, 2) [m]
    present: Bools  # (n,)


class TelemetrySink:
    """Who watches a run. `gave_up` is why the task will never be completed, once a node that decides has said so."""

    def __init__(self) -> None:
        self.told: list[TelemetryRecord] = []
        self.gave_up = ""

    def hear(self, scene: Scene, node: int, command: Command, decides: bool) -> None:
        """Take note of what a command tells."""
        if command.told:
            told = TelemetryRecord(scene.tick, scene.time_s, node, command.told, scene.position.copy(), scene.present)
            self.told.append(told)
        if command.gave_up and decides:
            self.gave_up = f"node {node} gave up: {command.gave_up}"
