"""Directions are kept in (-pi, pi], also at the cut."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from zwerm.maths.angles import wrap


@given(angle=st.floats(-1e3, 1e3))
@example(angle=math.nextafter(math.pi, 4.0))
@example(angle=math.nextafter(-math.pi, -4.0))
@example(angle=-math.pi)
def test_a_wrapped_angle_is_the_same_direction_in_range(angle):
    (wrapped,) = wrap([angle])
    assert -math.pi < wrapped <= math.pi
    assert math.remainder(wrapped - angle, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)


def test_half_a_turn_is_pi_from_either_side():
    assert np.array_equal(wrap([math.pi, -math.pi]), [math.pi, math.pi])
