"""Jam: no packet is received within `radius_m` of `center_m`, or within `rectangle_m` [xmin, ymin, xmax, ymax].

A coordinator has no position, so it is never jammed.
"""

from typing import Any, ClassVar, Final

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import Point, Positive, Rectangle
from zwerm.world.arena.arena import Arena
from zwerm.world.faults import FaultTable
from zwerm.world.faults.air import RadioFault, RadioFaultTable
from zwerm.world.radio import Packets, Transmissions, Verdict

# Range of the radius in random schedules, as a fraction of the diagonal of the arena.
_RANDOM_RADIUS: Final = (0.05, 0.25)


class JamTable(RadioFaultTable):
    """The region: a disc or a rectangle."""

    center_m: Point | None = None
    radius_m: Positive | None = None
    rectangle_m: Rectangle | None = None


class Jam(RadioFault):
    """Drops packets to receivers in a region."""

    Parameters: ClassVar[type[FaultTable]] = JamTable
    cause: ClassVar[str] = "jam"
    in_network: ClassVar[bool] = True

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Test the positions of the receivers at the time of sending."""
        table = self.parameters
        position, receiver = sent.scene.position, packets.receiver
        bodies = receiver < len(position)
        x, y = position[np.where(bodies, receiver, 0)].T
        if table.rectangle_m is not None:
            xmin, ymin, xmax, ymax = table.rectangle_m
            inside = (xmin <= x) & (x <= xmax) & (ymin <= y) & (y <= ymax)
        else:
            inside = np.hypot(x - table.center_m[0], y - table.center_m[1]) <= table.radius_m
        return Verdict(inside & bodies)

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return the mistakes in the region and `channel`."""
        found: list[str] = []
        disc = parameters.center_m is not None and parameters.radius_m is not None
        if disc == (parameters.rectangle_m is not None):
            found.append(": expected either center_m and radius_m, or rectangle_m")
        return found + super().check(parameters, scenario)

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return a random disc with its centre in the bounds of the arena."""
        xmin, ymin, xmax, ymax = arena.bounds
        center = [round(float(stream.uniform(*ends)), 3) for ends in ((xmin, xmax), (ymin, ymax))]
        radius_m = float(stream.uniform(*_RANDOM_RADIUS)) * float(np.hypot(xmax - xmin, ymax - ymin))
        return {"channel": "robots", "center_m": center, "radius_m": round(radius_m, 3)}
