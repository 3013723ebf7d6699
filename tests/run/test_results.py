"""A result as arrays and as pandas frames, without a recording."""

import sys
from pathlib import Path

import numpy as np
import pytest
from support import scenario

import zwerm
from zwerm.errors import MissingExtraError
from zwerm.record.recording import Recording


@pytest.fixture
def result() -> zwerm.RunResult:
    measured = {"cells": [4, 4], "every_s": 0.5}
    return zwerm.run(scenario(robots={"controller": "reporters:Reports", "sensors": []}, metrics=measured), 1, "inline")


def test_positions_are_arrays_with_a_sample_at_every_tick_of_a_short_run(result: zwerm.RunResult) -> None:
    poses = result.positions
    assert poses.time_s.tolist() == pytest.approx([0.1 * tick for tick in range(21)])
    assert poses.node.tolist() == [0, 1, 2, 3]
    for array in (poses.x_m, poses.y_m, poses.heading_rad, poses.present):
        assert array.shape == (21, 4)
    assert poses.present.all()
    step = np.hypot(np.diff(poses.x_m, axis=0), np.diff(poses.y_m, axis=0))
    assert 0.0 < step.max() < 0.02


def test_a_robot_that_is_not_in_the_arena_has_no_pose() -> None:
    settings = ["arena.size_m=[2.0,1.4]", "base.pose=[0.2,0.7,0.0]", "robots.count=5", "time.duration_s=1.0"]
    poses = zwerm.run("sensor-coverage", runner="inline", overrides=settings).positions
    assert not poses.present[0, 4]
    assert np.isnan([poses.x_m[0, 4], poses.y_m[0, 4], poses.heading_rad[0, 4]]).all()
    assert np.isfinite(poses.x_m[poses.present]).all()


@pytest.mark.parametrize(("count", "words"), [(1, "1 robot, 0.1 s"), (2, "2 robots, 0.1 s")])
def test_a_title_names_the_number_of_robots(count: int, words: str) -> None:
    robots = {"count": count, "controller": "reporters:Reports", "sensors": []}
    assert zwerm.run(scenario(robots=robots, time={"duration_s": 0.1}), 1, "inline").ending == words


def test_an_interrupt_while_the_recording_is_closed_does_not_lose_the_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    close = Recording.close

    def closed_and_interrupted(recording: Recording) -> None:
        close(recording)
        monkeypatch.undo()
        raise KeyboardInterrupt

    monkeypatch.setattr(Recording, "close", closed_and_interrupted)
    robots = {"count": 2, "controller": "reporters:Reports", "sensors": []}
    found = zwerm.run(scenario(robots=robots, time={"duration_s": 0.3}), 1, record=tmp_path / "run.mcap")
    assert (found.outcome, found.ticks) == ("interrupted", 3)


def test_a_result_prints_as_one_line(result: zwerm.RunResult) -> None:
    assert repr(result).startswith(f"<RunResult {result.title}: {result.outcome}, ")
    assert repr(result).endswith(f"trace {result.trace}>")
    assert "\n" not in repr(result)


def test_metrics_over_time_are_arrays(result: zwerm.RunResult) -> None:
    assert result.series["time_s"].tolist() == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    assert result.series["cell_coverage_fraction"].dtype == np.float64


def test_frames_hold_what_the_arrays_hold(result: zwerm.RunResult) -> None:
    pytest.importorskip("pandas")
    positions, metrics, telemetry = (result.to_frame(kind) for kind in ("positions", "metrics", "telemetry"))
    assert list(positions.columns) == ["time_s", "node", "x_m", "y_m", "heading_rad", "present"]
    assert len(positions) == 21 * 4
    row = positions.iloc[4 * 7 + 2]
    assert (row["node"], row["x_m"], row["y_m"]) == (2, result.positions.x_m[7, 2], result.positions.y_m[7, 2])
    assert metrics["cell_coverage_fraction"].tolist() == result.series["cell_coverage_fraction"].tolist()
    assert telemetry.groupby("name")["value"].max().to_dict() == {"tick": 19.0, "node": 3.0, "half": 0.5, "even": 1.0}
    with pytest.raises(ValueError, match="to_frame: expected one of positions, metrics, telemetry, got 'nix'"):
        result.to_frame("nix")  # type: ignore[arg-type]


def test_without_pandas_a_frame_is_refused_in_one_line(
    result: zwerm.RunResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError, match=r"^to_frame needs pandas \(.*\): pip install 'zwerm\[frames\]'$"):
        result.to_frame()
