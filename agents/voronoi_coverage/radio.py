"""Voronoi coverage with neighbours known from packets instead of a sensor, so lost and late packets have an effect.

Every robot senses its own pose, and broadcasts it with the field's value there. It assumes that the other robots are at
the places of their latest packets. It removes a robot from which no packet came for `memory_s`. It listens for one
period before it first moves. A robot without another robot stays at its place, as the SwarmBots did: its cell would
be the whole region. A packet carries a checksum; foreign and damaged packets are ignored. With `estimate =
"quadratic"` the received values add a quadratic term to the estimate of the field.
"""

import math
import struct
import zlib
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.agents.voronoi_coverage.quadratic import NeighbourSample, bordering, fit, quadratic_centroid
from zwerm.maths.polygons import estimated_centroid, nearest_point, voronoi_cell
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission

CHANNEL: Final = "robots"

# The sender's id, when it was sent [s], position [m] and field value there; then the checksum of those.
_LAYOUT: Final = struct.Struct("<Idddd")
_SUM: Final = struct.Struct("<I")


class NeighbourReport(NamedTuple):
    """The latest packet of a robot: its time [s], the position [m] in the frame of the arena, and the field's value there."""

    time_s: float
    x_m: float
    y_m: float
    value: float


def pack(node: int, report: NeighbourReport) -> bytes:
    """Return the packet with this message."""
    body = _LAYOUT.pack(node, *report)
    return body + _SUM.pack(zlib.crc32(body))


def unpack(payload: bytes) -> tuple[int, NeighbourReport] | None:
    """Return the sender and its message, or None for a foreign or damaged packet."""
    if len(payload) != _LAYOUT.size + _SUM.size:
        return None
    body = payload[: _LAYOUT.size]
    if _SUM.unpack(payload[_LAYOUT.size :])[0] != zlib.crc32(body):
        return None
    node, *numbers = _LAYOUT.unpack(body)
    return (node, NeighbourReport(*numbers)) if all(map(math.isfinite, numbers)) else None


class RadioCoverageTable(Struct, frozen=True, forbid_unknown_fields=True):
    """The gain k, the period of broadcasts [s], the time for which packets are kept [s], and the estimate of the
    field.

    It is done while its own error is below `tolerance_m`.
    """

    gain_per_s: Annotated[float, Meta(gt=0.0)] = 5.0
    every_s: Annotated[float, Meta(ge=0.0)] = 0.1
    memory_s: Annotated[float, Meta(gt=0.0)] = 2.0
    estimate: Literal["linear", "quadratic"] = "linear"
    tolerance_m: Annotated[float, Meta(ge=0.0)] = 0.0


class RadioCoverage(Controller):
    """Schwager 2006, algorithm 1, over a radio."""

    sensors: ClassVar[tuple[str, ...]] = ("pose", "boundary", "field")
    Parameters: ClassVar[type[Struct]] = RadioCoverageTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._table: Any = self.parameters
        self._every_ticks = max(1, round(self._table.every_s / setup.dt_s))
        self._reports: dict[int, NeighbourReport] = {}

    def step(self, observation: Observation) -> Command:
        """Return the velocity u = k (C_hat - p) for the latest known positions of the others, and broadcast if it is due."""
        table, pose, here = self._table, observation.pose, observation.field
        assert pose is not None
        assert observation.boundary is not None
        assert here is not None
        self._listen(observation)
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        samples = []
        for _, report in sorted(self._reports.items()):
            dx, dy = report.x_m - pose.x_m, report.y_m - pose.y_m
            samples.append(NeighbourSample(cos * dx + sin * dy, cos * dy - sin * dx, report.value))
        cell = voronoi_cell(observation.boundary, [(sample.x, sample.y) for sample in samples])
        field = here.value, here.gradient_x, here.gradient_y
        if table.estimate == "quadratic":
            centroid = quadratic_centroid(cell, *field, fit(*field, bordering(cell, samples)))
        else:
            centroid = estimated_centroid(cell, *field)
        x, y = centroid or nearest_point(observation.boundary)
        moves = bool(samples) and observation.tick > self._every_ticks
        # Robots broadcast at different ticks, so that not all broadcast at once.
        is_due = (observation.tick + self.setup.node) % self._every_ticks == 0
        own = NeighbourReport(observation.time_s, pose.x_m, pose.y_m, here.value)
        return Command(
            drive=BodyVelocity(table.gain_per_s * x, table.gain_per_s * y) if moves else BodyVelocity(),
            outbox=(Transmission(CHANNEL, pack(self.setup.node, own)),) if is_due else (),
            done=moves and math.hypot(x, y) < table.tolerance_m,
        )

    def _listen(self, observation: Observation) -> None:
        """Store the newest message of each robot; packets may overtake one another."""
        for packet in observation.inbox:
            received = unpack(packet.payload) if packet.channel == CHANNEL else None
            if received is not None and received[0] != self.setup.node:
                node, report = received
                if node not in self._reports or self._reports[node].time_s <= report.time_s:
                    self._reports[node] = report
        oldest_s = observation.time_s - self._table.memory_s
        self._reports = {node: report for node, report in self._reports.items() if report.time_s >= oldest_s}
