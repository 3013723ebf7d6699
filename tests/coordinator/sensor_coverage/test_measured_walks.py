"""The coordinator measures how far a walking robot is from its slot and from the robots in sight, where the walk ends."""

import math

import numpy as np
import pytest

from zwerm.coordinator.sensor_coverage.coordinator import SensorCoverageCoordinator
from zwerm.run.runner import run

# Two rooms of 1.2 m with a door of 0.3 m.
WALL = "[1.2,0],[1.2,0.4],[1.3,0.4],[1.3,0]", "[1.3,1.2],[1.3,0.7],[1.2,0.7],[1.2,1.2]"
ROOMS = f"arena.polygon=[[0,0],{WALL[0]},[2.5,0],[2.5,1.2],{WALL[1]},[0,1.2]]"


@pytest.mark.parametrize("noise_rad", [0.0, math.pi / 72.0])
def test_the_distances_of_robots_after_walks_are_true(noise_rad: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that counted as a hop away drove past its next slot, and what was seen of walls from there was forgotten."""
    started, off_m, missing = list[SensorCoverageCoordinator](), list[float](), 0
    begin = SensorCoverageCoordinator.__init__
    monkeypatch.setattr(
        SensorCoverageCoordinator, "__init__", lambda self, setup: (begin(self, setup), started.append(self))[0]
    )
    for seed in range(101, 114):
        settings = (
            ROOMS,
            f"base.pose=[0.4,0.6,{0.4 * seed}]",
            "robots.count=25",
            f"robots.sensors.0.sd_rad={noise_rad}",
        )
        result = run("sensor-coverage-narrow", seed, "inline", settings)
        assert result.outcome == "completed"
        slots, idle, places = started[-1].slots, started[-1].walking.idle, result.positions
        column = {int(node): number for number, node in enumerate(places.node)}
        at = {
            slot: (places.x_m[-1, column[node]], places.y_m[-1, column[node]]) for slot, node in slots.occupant.items()
        }
        for slot in idle:
            known = {b: length_m for (a, b), length_m in slots.length_m.items() if a == slot and b in at}
            missing += not known
            off_m += [abs(length_m - math.dist(at[slot], at[other])) for other, length_m in known.items()]
    assert missing == 0
    assert len(off_m) > 10
    assert np.median(off_m) < 0.03
    assert np.quantile(off_m, 0.9) < 0.1
