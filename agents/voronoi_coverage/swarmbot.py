"""Voronoi coverage as the paper's robots ran it: neighbours within a radius only, no boundary sensor, and noisy light.

Differences from the algorithm as printed (section V-B and figures 6, 7 and 9): Phi_offset + light is the field;
- a robot whose target is within a threshold of where it stands remains there.

The lengths of the rules and the magnitude of the gradient are not in the paper; those here are our choice. The
limit of a cell to the range is our choice, too.
"""

import math
from typing import Annotated, Any, ClassVar, Final

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.maths.polygons import COINCIDENT_M, Point, Polygon, clip, estimated_centroid, voronoi_cell
from zwerm.wire.messages import BodyVelocity, Command, Observation, Wake

PositiveNumber = Annotated[float, Meta(gt=0.0)]
NonNegativeNumber = Annotated[float, Meta(ge=0.0)]

# Neighbours with a smaller difference of directions are in line: the nearer one hides the other's bisector [rad].
_IN_LINE_RAD: Final = 1e-9


class SwarmBotTable(Struct, frozen=True, forbid_unknown_fields=True):
    """Lengths in m. `gradient_magnitude` is per metre, in the unit of the field; without it the gradient is as sensed.

    The first `beacons` robots are stationary: they serve as neighbours only.
    """

    gain_per_s: PositiveNumber = 2.0
    horizon_m: PositiveNumber = 1.0
    threshold_m: NonNegativeNumber = 0.0
    triangle_base_m: PositiveNumber = 0.5
    triangle_height_m: PositiveNumber = 0.5
    line_m: PositiveNumber = 0.3
    offset: float = 0.0
    gradient_magnitude: NonNegativeNumber | None = None
    beacons: Annotated[int, Meta(ge=0)] = 0


def closed_cell(others: list[Point], table: SwarmBotTable) -> Polygon:
    """Return the cell of a robot at the origin [m], closed by the three rules; empty for a robot without neighbours.

    A robot at the same place is no neighbour: it has no direction.
    """
    others = [other for other in others if math.hypot(*other) > COINCIDENT_M]
    if not others:
        return []
    directions = _directions(others)
    if len(directions) == 1:
        return _triangle(min(others, key=lambda other: math.hypot(*other)), table)
    reach = table.horizon_m
    cell = voronoi_cell([(-reach, -reach), (reach, -reach), (reach, reach), (-reach, reach)], others)
    for angle, after in zip(directions, [*directions[1:], directions[0]], strict=True):
        gap = (after - angle) % math.tau
        if gap >= math.pi - _IN_LINE_RAD:
            # Rule 3: a line perpendicular to the bisector of the infinite region, at a constant distance.
            middle = angle + 0.5 * gap
            cell = clip(cell, math.cos(middle), math.sin(middle), table.line_m)
    return cell


def _directions(others: list[Point]) -> list[float]:
    """Return the directions in which there are robots [rad], ascending, each once."""
    found: list[float] = []
    for angle in sorted([math.atan2(y, x) for x, y in others]):
        if not found or angle - found[-1] > _IN_LINE_RAD:
            found.append(angle)
    if len(found) > 1 and found[0] + math.tau - found[-1] <= _IN_LINE_RAD:
        found.pop()
    return found


def _triangle(other: Point, table: SwarmBotTable) -> Polygon:
    """Return rule 2's isosceles triangle, its base on the bisector with the only neighbour, its apex away from it."""
    distance = math.hypot(*other)
    nx, ny = other[0] / distance, other[1] / distance
    x, y = 0.5 * other[0], 0.5 * other[1]
    half, height = 0.5 * table.triangle_base_m, table.triangle_height_m
    return [
        (x - height * nx, y - height * ny),
        (x + half * ny, y - half * nx),
        (x - half * ny, y + half * nx),
    ]


class SwarmBotCoverage(Controller):
    """Schwager 2006, algorithm 1 with the modifications of section V-B."""

    sensors: ClassVar[tuple[str, ...]] = ("neighbours", "field")
    Parameters: ClassVar[type[Struct]] = SwarmBotTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        table: Any = self.parameters
        self._table: SwarmBotTable = table
        self._stationary = setup.node < table.beacons

    def step(self, observation: Observation) -> Command:
        """Return the velocity towards the estimated centroid, or none within the threshold."""
        if self._stationary:
            return Command(drive=BodyVelocity(), wake=Wake())
        table, light = self._table, observation.field
        assert observation.neighbours is not None
        assert light is not None
        gx, gy = light.gradient_x, light.gradient_y
        if table.gradient_magnitude is not None:
            steepness = math.hypot(gx, gy)
            scale = table.gradient_magnitude / steepness if steepness > 0.0 else 0.0
            gx, gy = gx * scale, gy * scale
        cell = closed_cell([(other.x_m, other.y_m) for other in observation.neighbours], table)
        # Rule 1: without neighbours the centroid is where the robot is.
        x, y = estimated_centroid(cell, table.offset + light.value, gx, gy) or (0.0, 0.0)
        if math.hypot(x, y) <= table.threshold_m:
            return Command(drive=BodyVelocity())
        return Command(drive=BodyVelocity(table.gain_per_s * x, table.gain_per_s * y))
