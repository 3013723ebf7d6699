"""Trials of a study: rows, continuation after an interruption, files, failures."""

from collections.abc import Callable
from pathlib import Path

import pytest
from study_files import GRID, TINY, run_here

from zwerm.errors import ScenarioError
from zwerm.run.runner import run
from zwerm.study.rows import Rows, read_rows
from zwerm.study.study_runner import run_study
from zwerm.study.study_tables import Study
from zwerm.study.trial_plan import make_points


def test_a_row_equals_the_result_of_a_run_with_its_seed(write: Callable[..., Study], tmp_path: Path) -> None:
    result = run_here(write(GRID), tmp_path / "out.parquet")
    assert (result.planned, result.ran, result.done, result.failed, result.interrupted) == (6, 6, 6, 0, False)
    rows = read_rows(tmp_path / "out.parquet")
    assert [(row["robots.count"], row["seed"]) for row in rows] == [(n, seed) for n in (1, 4) for seed in (1, 2, 3)]
    same = run(tmp_path / "tiny-scenario.toml", 2, "inline", ["robots.count=4"])
    row = rows[4]
    assert row["trace"] == same.trace
    assert row["outcome"] == "time-limit"
    assert row["ticks"] == 20
    assert row["cell_coverage_fraction"] == same.metrics["cell_coverage_fraction"]
    assert same.cell_counts is not None
    assert row["cell_counts"] == same.cell_counts.ravel().tolist()
    assert rows[0]["trace"] != rows[1]["trace"]


def test_a_study_continues_with_its_missing_trials_only(write: Callable[..., Study], tmp_path: Path) -> None:
    out, study = tmp_path / "out.parquet", write(GRID)
    assert run_here(study, out, seeds=[1, 2]).ran == 4
    before = read_rows(out)
    assert run_here(study, out).ran == 2
    assert [row for row in read_rows(out) if row["seed"] < 3] == before
    assert run_here(study, out).ran == 0
    fewer = run_here(study, out, seeds=[2])
    assert (fewer.ran, fewer.done, len(read_rows(out))) == (0, 2, 6)


def test_rows_of_a_changed_scenario_are_replaced(write: Callable[..., Study], tmp_path: Path) -> None:
    out = tmp_path / "out.parquet"
    run_here(write(GRID), out)
    before = {row["fingerprint"] for row in read_rows(out)}
    changed = run_here(write(GRID), out, sets=["time.duration_s=1"])
    rows = read_rows(out)
    assert (changed.ran, len(rows)) == (6, 6)
    assert {row["ticks"] for row in rows} == {10}
    assert not before & {row["fingerprint"] for row in rows}
    # The words in a scenario decide nothing.
    assert run_here(write(GRID), out, sets=["time.duration_s=1", "summary=other words"]).ran == 0
    # The controller's code does.
    file = tmp_path / "study_robots.py"
    file.write_text(file.read_text() + "\n# changed\n")
    assert run_here(write(GRID), out, sets=["time.duration_s=1"]).ran == 6


def test_a_row_is_stored_when_its_trial_ends(write: Callable[..., Study], tmp_path: Path) -> None:
    out, study = tmp_path / "out.parquet", write(TINY)

    class Stop:
        left = 2

        def begin(self, total: int) -> None:
            assert total == 3

        def ended(self, failed: bool) -> None:
            self.left -= 1
            if not self.left:
                raise MemoryError

    with pytest.raises(MemoryError):
        run_here(study, out, listener=Stop())
    journal = tmp_path / "out.parquet.journal"
    assert not out.exists()
    with journal.open("ab") as file:
        file.write(b'{"study":"tiny","variant":"","se')
    assert run_here(study, out).ran == 1
    assert len(read_rows(out)) == 3
    assert not journal.exists()


def test_a_second_study_with_the_same_file_is_refused(tmp_path: Path) -> None:
    with Rows(tmp_path / "out.parquet"), pytest.raises(ScenarioError, match="another study is writing to it"):
        Rows(tmp_path / "out.parquet")
    with Rows(tmp_path / "out.parquet"):
        pass


def test_a_file_without_study_results_is_refused_and_unchanged(write: Callable[..., Study], tmp_path: Path) -> None:
    out = tmp_path / "notes.parquet"
    out.write_text("my notes")
    with pytest.raises(ScenarioError, match="expected a Parquet file of a study's results"):
        run_here(write(TINY), out)
    assert out.read_text() == "my notes"


def test_a_file_that_cannot_be_written_is_an_error_of_one_line(write: Callable[..., Study], tmp_path: Path) -> None:
    out = tmp_path / "tiny-scenario.toml" / "out.parquet"
    study = write(TINY)
    with pytest.raises(ScenarioError) as raised:
        run_here(study, out)
    assert raised.value.mistakes[0].startswith(f"{out}: cannot be written: ")


def test_a_change_of_a_file_named_by_the_scenario_changes_the_fingerprint(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    study = write(TINY)
    (tmp_path / "hall.geojson").write_text('{"type": "Polygon", "coordinates": [[[0, 0], [2, 0], [2, 1], [0, 0]]]}')
    text = (tmp_path / "tiny-scenario.toml").read_text().replace("size_m = [1.0, 1.0]", 'geojson = "hall.geojson"')
    (tmp_path / "tiny-scenario.toml").write_text(text)
    (before,) = make_points(study)
    (same,) = make_points(study)
    (tmp_path / "hall.geojson").write_text('{"type": "Polygon", "coordinates": [[[0, 0], [2, 0], [2, 2], [0, 0]]]}')
    (after,) = make_points(study)
    assert before.fingerprint == same.fingerprint != after.fingerprint


def test_a_failed_trial_gives_a_row_with_its_reason(write: Callable[..., Study], tmp_path: Path) -> None:
    out = tmp_path / "out.parquet"
    study = write(TINY.replace("seeds = 3", "seeds = 8"), "Raises")
    result = run_here(study, out)
    rows = read_rows(out)
    failed = [row for row in rows if row["outcome"] == "failed"]
    assert len(rows) == 8
    assert 0 < len(failed) < 8
    assert {row["reason"] for row in failed} == {
        "node 0 crashed at tick 3: ValueError: no luck (study_robots.py:16, in step)"
    }
    assert result.failed == len(failed)
    assert result.results.lines()[0].sample.n == 8 - len(failed)
    assert run_here(study, out).ran == 0
    assert run_here(study, out, retry=True).ran == len(failed)


def test_a_placement_without_room_fails_its_trial_only(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(TINY + "[grid]\n'robots.count' = [2, 300]")
    result = run_here(study, tmp_path / "out.parquet")
    outcomes = {(row["robots.count"], row["outcome"]) for row in read_rows(result.path)}
    assert outcomes == {(2, "time-limit"), (300, "failed")}


def test_a_worker_that_dies_fails_its_own_trial_only(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(TINY.replace("seeds = 3", "seeds = 6"), "Dies")
    result = run_study(study, tmp_path / "dies.parquet", jobs=2)
    rows = read_rows(result.path)
    died = [row["seed"] for row in rows if row["outcome"] == "failed"]
    assert all("its process died" in row["reason"] for row in rows if row["seed"] in died)

    raises = run_here(write(TINY.replace("seeds = 3", "seeds = 6"), "Raises"), tmp_path / "raises.parquet")
    assert died == [row["seed"] for row in read_rows(raises.path) if row["outcome"] == "failed"]
    # In processes or not: the same rows.
    keep = ("seed", "cell_coverage_fraction", "trace", "ticks")
    there, here = (
        [{k: r[k] for k in keep} for r in read_rows(p) if "trace" in r and r["outcome"] != "failed"]
        for p in (result.path, raises.path)
    )
    assert there == here
    assert len(there) == 6 - len(died) > 0


def test_counts_of_robots_are_sampled_over_time(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(
        TINY.replace("seeds = 3", "seeds = 1")
        + "series = ['robots_in_arena', 'robots_entered']\n"
        + "set = ['robots.count=5', 'robots.entrance.every_s=0.5', 'robots.entrance.entry_m=[0, 0, 1, 1]']\n"
    )
    (row,) = read_rows(run_here(study, tmp_path / "out.parquet").path)
    assert len(row["series_time_s"]) == 121
    assert row["series_time_s"][0] == 0.0
    assert row["series_time_s"][-1] == 2.0
    assert row["robots_in_arena_series"] == row["robots_entered_series"]
    at = dict(zip(row["series_time_s"], row["robots_entered_series"], strict=True))
    assert [at[t] for t in (0.0, 0.45, 0.55, 1.05, 2.0)] == [1, 1, 2, 3, 5]


HANGS_OR_DIES = """
import os, time
from zwerm.agents.runtime.contract import Controller
from zwerm.wire.messages import Command

class Dies(Controller):
    def step(self, observation):
        os._exit(9)

class Hangs(Controller):
    def step(self, observation):
        time.sleep(3600.0)
"""


@pytest.mark.parametrize(
    ("controller", "reason"), [("Dies", "its process died"), ("Hangs", "it had no result within 3 s")]
)
def test_the_only_trial_of_a_study_can_neither_end_nor_hang_it(
    write: Callable[..., Study], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, controller: str, reason: str
) -> None:
    (tmp_path / "hard_to_end.py").write_text(HANGS_OR_DIES)
    study = write(TINY.replace("seeds = 3", "seeds = 1") + f"set = ['robots.controller=hard_to_end:{controller}']\n")
    result = run_study(study, tmp_path / "out.parquet", timeout_s=3.0)
    [row] = read_rows(result.path)
    assert row["outcome"] == "failed"
    assert row["reason"].startswith(reason)
