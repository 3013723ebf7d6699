"""A sleeper in touch with nothing is read again only when it moves, or a body near it does: the runs are the same."""

import numpy as np
import pytest

from zwerm.run.assembly import assemble_run
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.world.scene import PAIRS_MAX, Ints, Scene
from zwerm.world.sensors.touch import Touch

HALL = ("arena.size_m=[2.0,1.6]", "base.pose=[0.2,0.8,0.3]", "robots.count=20")
STUCK = 'faults=[{kind="stuck_touch",robots=[1,3],switch=2,closed=true,at_s=20.0,for_s=30.0}]'
RESTART = 'faults=[{kind="crash",nodes=[2],at_s=20.0,for_s=5.0}]'


def reads_and_trace(monkeypatch: pytest.MonkeyPatch, *settings: str) -> tuple[int, bytes | str]:
    """Return how many readings of the touch sensor a run made, and its trace."""
    count, read = [0], Touch.read

    def counted(self: Touch, scene: Scene, robots: Ints) -> list[tuple[object, ...]]:
        count[0] += len(robots)
        return read(self, scene, robots)  # type: ignore[return-value]

    with monkeypatch.context() as patch:
        patch.setattr(Touch, "read", counted)
        trace = run("sensor-coverage", 4, "inline", (*HALL, *settings)).trace
    return count[0], trace


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param((), id="central"),
        pytest.param((RESTART,), id="a robot returns"),
        pytest.param((STUCK, "time.duration_s=100.0"), id="a switch is stuck for a while"),
    ],
)
def test_a_run_is_the_same_with_fewer_readings(monkeypatch: pytest.MonkeyPatch, settings: tuple[str, ...]) -> None:
    fewer, trace = reads_and_trace(monkeypatch, *settings)
    monkeypatch.setattr(Touch, "reach_at_rest_m", lambda self, scene: None)
    all_readings, same = reads_and_trace(monkeypatch, *settings)
    assert trace == same
    assert fewer < all_readings


def test_switches_that_err_are_read_at_every_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = ("robots.sensors.1.false_negative=0.01", "time.duration_s=60.0")
    fewer, trace = reads_and_trace(monkeypatch, *settings)
    monkeypatch.setattr(Touch, "reach_at_rest_m", lambda self, scene: None)
    assert reads_and_trace(monkeypatch, *settings) == (fewer, trace)


def test_a_body_that_moved_counts_up_to_a_distance() -> None:
    scene = assemble_run(load("sensor-coverage", HALL), 1)[0].scene
    scene.position[:4] = (0.5, 0.5), (0.6, 0.5), (0.9, 0.5), (1.5, 0.5)
    scene.moved[:] = False
    robots = np.arange(4)
    assert scene.moved_near(robots, 0.2).tolist() == [False] * 4
    scene.moved[1] = True
    assert scene.moved_near(robots, 0.2).tolist() == [True, True, False, False]
    assert scene.moved_near(robots, 0.31).tolist() == [True, True, True, False]
    many = np.zeros(PAIRS_MAX + 1, dtype=np.int64) + 3
    assert scene.moved_near(many, 0.2).all(), "too many pairs to compare: all count"
