"""A robot dies in an opening, and beyond it is space: `completed` must not be said while that is unseen."""

import pytest

from benchmarks.common.small_buildings import CrashInOpening
from benchmarks.common.until_in_sight import UntilInSight
from zwerm.run.runner import run


def building(
    polygon: str, opening: tuple[float, float, float, float], pose: str = "[0.2,0.6,0.3]", at_s: float = 1.0
) -> tuple[str, ...]:
    """Return the settings of a building with noise-free odometry, in which a robot dies in an opening after `at_s`."""
    names = ("x_min", "x_max", "y_min", "y_max")
    bounds = ", ".join(f"{name}={value}" for name, value in zip(names, opening, strict=True))
    return (
        f"arena.polygon={polygon}",
        f"base.pose={pose}",
        "robots.count=25",
        "robots.sensors.2.distance_sd_fraction=0.0",
        f'faults=[{{kind="{CrashInOpening.__module__}:CrashInOpening", at_s={at_s}, {bounds}}}]',
    )


# Two rooms, with a door of 0.2 m, or with a passage of that width and a bend. A body is 0.14 m wide.
DOOR = building(
    "[[0,0],[1.2,0],[1.2,0.5],[1.3,0.5],[1.3,0],[2.5,0],[2.5,1.2],[1.3,1.2],[1.3,0.7],[1.2,0.7],[1.2,1.2],[0,1.2]]",
    (1.15, 1.33, 0.45, 0.75),
)
BEND = building(
    "[[0,0],[1.2,0],[1.2,0.5],[1.6,0.5],[1.6,1.2],[2.6,1.2],[2.6,2.2],[1.4,2.2],[1.4,0.7],[1.2,0.7],[1.2,1.2],[0,1.2]]",
    (1.36, 1.6, 0.5, 0.74),
)
# A door of 0.25 m in a corner of both rooms.
CORNER = building(
    "[[0,0],[1.2,0],[1.2,0.02],[1.3,0.02],[1.3,0],[2.5,0],[2.5,1.2],[1.3,1.2],[1.3,0.271],[1.2,0.271],[1.2,1.2],[0,1.2]]",
    (1.13, 1.37, 0.0, 0.291),
    "[0.2,0.52,0.31]",
    39.1,
)
ALONE = ("services.path=gradient",)


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param(DOOR, id="central door"),
        pytest.param(BEND, id="central bend"),
        pytest.param((*DOOR, *ALONE), id="decentralised door"),
        pytest.param((*BEND, *ALONE), id="decentralised bend"),
        pytest.param((*CORNER, *ALONE), id="decentralised door in a corner"),
    ],
)
def test_a_dead_body_in_an_opening_hides_no_room(settings: tuple[str, ...]) -> None:
    settings = (*settings, "time.duration_s=4000.0")
    result = run("sensor-coverage-narrow", 1, "inline", settings, watcher=UntilInSight())
    assert result.metrics["faults_missed"] == 0.0
    assert result.outcome != "completed" or result.metrics["reachable_coverage_fraction"] >= 0.98


def test_a_jamb_beside_a_robot_hides_no_bend() -> None:
    """The robot's ways along the wall begin at the jamb, one on each side of it."""
    result = run("sensor-coverage-narrow", 1, "inline", (*BEND[:-1], "time.duration_s=4000.0"), watcher=UntilInSight())
    assert result.metrics["reachable_coverage_fraction"] >= 0.98
