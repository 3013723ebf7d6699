"""Headings of base stations."""

import math

import pytest

import zwerm
from zwerm.errors import ScenarioError

HALL = ("arena.size_m=[2.6,2.0]", "robots.count=8", "time.duration_s=12.0")


def headings(seed: int, *overrides: str) -> list[float]:
    """Return the heading [rad] of the station at the start and at the end."""
    result = zwerm.run("sensor-coverage", seed=seed, runner="inline", overrides=(*HALL, *overrides))
    heading = result.positions.heading_rad
    return [float(heading[0, 0]), float(heading[-1, 0])]


def test_the_seed_draws_the_heading_of_a_base_station() -> None:
    drawn = [headings(seed, "base.pose=[0.2,1.0]") for seed in (1, 2, 3)]
    assert all(first == last for first, last in drawn), "a station never moves"
    assert len({first for first, _ in drawn}) == 3
    assert all(-math.pi <= first < math.pi for first, _ in drawn)
    assert headings(1, "base.pose=[0.2,1.0]") == drawn[0]


def test_a_given_heading_is_kept() -> None:
    assert headings(1, "base.pose=[0.2,1.0,0.7]")[0] == pytest.approx(0.7)


@pytest.mark.parametrize("pose", ["[0.2]", "[0.2,1.0,0.0,0.0]"])
def test_a_pose_has_two_or_three_numbers(pose: str) -> None:
    with pytest.raises(ScenarioError, match=r"base\.pose: expected"):
        headings(1, f"base.pose={pose}")
