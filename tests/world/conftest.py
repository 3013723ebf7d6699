"""Scenes to sense in, and arenas that hold every kind of wall."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from shapely.geometry import LineString, box

from zwerm.maths.keyed_random import Draws
from zwerm.scenario.types import OpenTable
from zwerm.world.arena.arena import Arena
from zwerm.world.scene import Scene
from zwerm.world.sensors import Sensor, Surroundings
from zwerm.world.sensors.registry import make_sensor

ARENAS = {
    "open": Arena(box(0.0, 0.0, 3.0, 3.0)),
    "walled": Arena(
        box(0.0, 0.0, 3.0, 3.0).difference(box(1.2, 0.4, 1.7, 1.1)),
        [LineString([(0.5, 2.2), (1.4, 1.5), (2.1, 2.4)]), LineString([(2.4, 0.3), (2.4, 1.6)])],
    ),
}

MakeScene = Callable[..., Scene]
MakeSensor = Callable[..., Sensor]


@pytest.fixture(scope="session", params=ARENAS)
def arena(request: pytest.FixtureRequest) -> Arena:
    """An arena without obstacles, then one with an obstacle and walls; both 3 m x 3 m."""
    return ARENAS[request.param]


@pytest.fixture(scope="session")
def walled() -> Arena:
    """The one with an obstacle and walls."""
    return ARENAS["walled"]


@pytest.fixture(scope="session")
def make_scene() -> MakeScene:
    """Make a scene of robots at x, y, heading."""

    def make(
        poses: Sequence[Sequence[float]],
        arena: Arena = ARENAS["open"],
        present: Sequence[bool] | None = None,
        tick: int = 0,
        seed: int = 1,
        radius_m: float = 0.037,
    ) -> Scene:
        table = np.array(poses, dtype=np.float64).reshape(-1, 3)
        here = np.ones(len(table), dtype=np.bool_) if present is None else np.array(present, dtype=np.bool_)
        moved = np.ones(len(table), dtype=np.bool_)
        position = np.ascontiguousarray(table[:, :2])
        return Scene(tick, 0.1 * tick, position, table[:, 2].copy(), here, moved, radius_m, arena, Draws(seed))

    return make


@pytest.fixture(scope="session")
def sensor_for() -> MakeSensor:
    """Make the sensor of a kind for a scene, as a scenario would."""

    def make(scene: Scene, kind: str, surroundings: dict[str, Any] | None = None, **parameters: object) -> Sensor:
        around = Surroundings(scene.arena, len(scene.present), **(surroundings or {}))
        return make_sensor(OpenTable.model_validate({"kind": kind, **parameters}), around, "robots.sensors.0", "here")

    return make
