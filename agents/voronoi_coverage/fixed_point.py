"""Voronoi coverage in integers, as the paper's robots computed it on a 40 MHz microcontroller without floating point.

Lengths are whole multiples of 2^-LENGTH_BITS m (a quarter of a millimetre), a field whole steps of its own unit times
`field_scale`. The same cell is clipped and the same moments are summed as in `zwerm.maths.polygons`. Products are
shifted right as soon as that costs no accuracy. So all numbers fit into 64 bits for regions up to 4 m wide. Arguments
and results are plain integers, so a type that behaves like an integer can count the operations.
"""

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, ClassVar, Final

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.wire.messages import BodyVelocity, Command, Observation

LENGTH_BITS: Final = 12
UNITS_PER_M: Final = 1 << LENGTH_BITS

# Bits dropped of a product of two lengths before it is multiplied again.
_DROPPED_BITS: Final = 8

Corner = tuple[int, int]


def _quotient(numerator: int, denominator: int) -> int:
    """Return the quotient to the nearest whole number: rounded down, every corner would be half a unit off."""
    return (2 * numerator + denominator) // (2 * denominator)


def clip(polygon: Sequence[Corner], a: int, b: int, twice_c: int) -> list[Corner]:
    """Return the part of `polygon` where 2 (a x + b y) <= twice_c, its new corners rounded to whole units."""
    kept: list[Corner] = []
    if not polygon:
        return kept
    x0, y0 = polygon[-1]
    over0 = 2 * (a * x0 + b * y0) - twice_c
    for corner in polygon:
        x1, y1 = corner
        over1 = 2 * (a * x1 + b * y1) - twice_c
        if (over0 < 0 < over1) or (over1 < 0 < over0):
            fall = over0 - over1
            kept.append((x0 + _quotient(over0 * (x1 - x0), fall), y0 + _quotient(over0 * (y1 - y0), fall)))
        if over1 <= 0:
            kept.append(corner)
        x0, y0, over0 = x1, y1, over1
    return kept


def voronoi_cell(region: Sequence[Corner], others: Iterable[Corner]) -> Sequence[Corner]:
    """Return the part of `region` that is no nearer to any of `others` than to the origin."""
    cell = region
    for x, y in others:
        distance2 = x * x + y * y
        if distance2 > 0:
            cell = clip(cell, x, y, distance2)
    return cell


def centroid(cell: Sequence[Corner], value: int, gx: int, gy: int) -> Corner | None:
    """Return the centroid of `cell` under value + (gx x + gy y) >> LENGTH_BITS; gx, gy are per metre. None without mass.

    The sums are the moments of eq. 16 times 24, over `_DROPPED_BITS` from the second order on.
    """
    if not cell:
        return None
    ox, oy = cell[0]
    s00 = s10 = s01 = s20 = s11 = s02 = 0
    x0 = y0 = 0
    for x, y in cell[1:]:
        x1, y1 = x - ox, y - oy
        w = x0 * y1 - x1 * y0
        sx, sy = x0 + x1, y0 + y1
        s00 += w
        s10 += w * sx
        s01 += w * sy
        s20 += w * ((sx * sx - x0 * x1) >> _DROPPED_BITS)
        s11 += w * ((2 * sx * sy - x0 * y1 - x1 * y0) >> _DROPPED_BITS)
        s02 += w * ((sy * sy - y0 * y1) >> _DROPPED_BITS)
        x0, y0 = x1, y1
    c1 = value + ((gx * ox + gy * oy) >> LENGTH_BITS)
    mass = 12 * c1 * s00 + ((4 * (gx * s10 + gy * s01)) >> LENGTH_BITS)  # eq. 18
    if mass <= 0:
        return None
    second = LENGTH_BITS - _DROPPED_BITS
    x = _quotient(4 * c1 * s10 + ((2 * gx * s20 + gy * s11) >> second), mass)  # eq. 17
    y = _quotient(4 * c1 * s01 + ((gx * s11 + 2 * gy * s02) >> second), mass)
    return ox + x, oy + y


def target(region: Sequence[Corner], others: Iterable[Corner], value: int, gx: int, gy: int) -> Corner:
    """Return the goal of a robot at the origin, in whole units; the origin itself if the goal is undefined."""
    cell = voronoi_cell(region, others)
    positive = cell
    for x, y in cell:
        if gx * x + gy * y < -value << LENGTH_BITS:
            positive = clip(cell, -gx, -gy, value << (LENGTH_BITS + 1))
            break
    return centroid(positive, value, gx, gy) or centroid(cell, 1, 0, 0) or (0, 0)


class IntegerTable(Struct, frozen=True, forbid_unknown_fields=True):
    """The gain k, steps of the field's sensor in one unit of the field, and the error up to which the robot is done [m]."""

    gain_per_s: Annotated[float, Meta(gt=0.0)] = 5.0
    field_scale: Annotated[int, Meta(gt=0)] = 1000
    tolerance_m: Annotated[float, Meta(ge=0.0)] = 0.0


class IntegerCoverage(Controller):
    """Schwager 2006, algorithm 1, in the integer arithmetic of section V-B. Only sensing and driving are in m."""

    sensors: ClassVar[tuple[str, ...]] = ("neighbours", "boundary", "field")
    Parameters: ClassVar[type[Struct]] = IntegerTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        table: Any = self.parameters
        self._scale = table.field_scale
        self._gain_per_unit_s = table.gain_per_s / UNITS_PER_M
        self._tolerance2 = (table.tolerance_m * UNITS_PER_M) ** 2

    def step(self, observation: Observation) -> Command:
        """Return the velocity u = k (C_hat - p). Schwager 2006, eq. 8."""
        here = observation.field
        assert observation.boundary is not None
        assert observation.neighbours is not None
        assert here is not None
        x, y = target(
            [(round(x * UNITS_PER_M), round(y * UNITS_PER_M)) for x, y in observation.boundary],
            [(round(other.x_m * UNITS_PER_M), round(other.y_m * UNITS_PER_M)) for other in observation.neighbours],
            round(here.value * self._scale),
            round(here.gradient_x * self._scale),
            round(here.gradient_y * self._scale),
        )
        k = self._gain_per_unit_s
        return Command(drive=BodyVelocity(k * x, k * y), done=x * x + y * y < self._tolerance2)
