"""The integer variant: its error against floating point, its cost, and its limits on the target machine."""

import operator
from collections import Counter
from typing import ClassVar

import numpy as np
import pytest

from zwerm.agents.voronoi_coverage.fixed_point import UNITS_PER_M, target
from zwerm.maths.polygons import estimated_centroid, voronoi_cell
from zwerm.world.fields.gaussians import Gaussians
from zwerm.world.geometry.tessellation import Tessellation

SCALE = 1000
HILL = Gaussians([0.5641895835477563], [(0.2, 0.2)], 0.5**0.5)


class Tally(int):
    """An integer that counts what is done with it, and remembers the widest result."""

    counts: ClassVar[Counter[str]] = Counter()
    widest_bits = 0

    @classmethod
    def reset(cls):
        cls.counts, cls.widest_bits = Counter(), 0


def _counting(name, kind):
    plain = getattr(operator, name)

    def operate(self, other):
        Tally.counts[kind] += 1
        result = plain(int(self), int(other))
        Tally.widest_bits = max(Tally.widest_bits, result.bit_length() + 1)
        return result if kind == "compare" else Tally(result)

    return operate


def _reflected(operate):
    return lambda self, other: operate(Tally(other), self)


for _name, _kind in {
    **dict.fromkeys(("add", "sub"), "add"),
    "mul": "multiply",
    "floordiv": "divide",
    **dict.fromkeys(("lshift", "rshift"), "shift"),
    **dict.fromkeys(("lt", "le", "gt", "ge"), "compare"),
}.items():
    _operate = _counting(_name, _kind)
    setattr(Tally, f"__{_name}__", _operate)
    if _kind != "compare":
        setattr(Tally, f"__r{_name}__", _reflected(_operate))
Tally.__neg__ = lambda self: Tally(-int(self))  # type: ignore[method-assign]


def cases(count, robots, size_m=1.0):
    """Yield (region, others, value, gx, gy) in floats, as robots in the middle of random swarms observe them."""
    random = np.random.default_rng(8)
    tessellation = Tessellation()
    while count > 0:
        position = random.uniform(0.02 * size_m, 0.98 * size_m, (robots, 2))
        pairs = tessellation.pairs(position)
        value, gradient = HILL.value(position), HILL.gradient(position)
        for robot in range(min(count, robots)):
            others = pairs[(pairs == robot).any(axis=1)].sum(axis=1) - robot
            region = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * size_m - position[robot]
            yield region, position[others] - position[robot], value[robot], *gradient[robot]
            count -= 1


def in_units(region, others, value, gx, gy, kind=int):
    def whole(points):
        return [tuple(kind(round(float(part) * UNITS_PER_M)) for part in point) for point in points]

    return whole(region), whole(others), *(kind(round(float(part) * SCALE)) for part in (value, gx, gy))


def in_floats(region, others, value, gx, gy):
    cell = voronoi_cell(list(map(tuple, region.tolist())), list(map(tuple, others.tolist())))
    return estimated_centroid(cell, value, gx, gy)


@pytest.mark.parametrize("robots", [10, 100, 1000])
def test_integers_find_the_centroid_to_a_fraction_of_a_millimetre(robots):
    errors = []
    for case in cases(2000, robots):
        found = np.array(target(*in_units(*case))) / UNITS_PER_M
        errors.append(np.hypot(*(found - in_floats(*case))))
    assert 1e-5 < np.mean(errors) < 2e-4  # a unit is 2.4e-4 m
    assert np.max(errors) < 4e-3


def test_everything_fits_into_64_bits_in_a_room_of_four_metres():
    Tally.reset()
    for robots in (2, 10, 100):
        for case in cases(200, robots, size_m=4.0):
            target(*in_units(*case, kind=Tally))  # type: ignore[misc]
    assert 40 < Tally.widest_bits <= 64


def test_a_cycle_with_eight_neighbours_costs_what_is_documented():
    Tally.reset()
    angles = np.arange(8) * (np.pi / 4) + 0.1
    ring = 0.3 * np.column_stack([np.cos(angles), np.sin(angles)])
    region = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    target(*in_units(region, ring, 0.5, 0.1, -0.2, kind=Tally))
    assert dict(Tally.counts) == {"multiply": 407, "add": 347, "compare": 200, "divide": 34, "shift": 33}
