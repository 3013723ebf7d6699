"""`zwerm study`: exit status, Ctrl-C, and no process left."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from study_files import DEADLINE_S, GRID, TINY, run_here
from support import ROOT
from waiting import until

from zwerm.study.rows import read_rows
from zwerm.study.study_tables import Study, load_study

COMMAND = [sys.executable, "-c", "from zwerm.cli.app import main; main()", "study"]


def start(tmp_path: Path, *arguments: str) -> "subprocess.Popen[str]":
    """Start the command in a process group of its own."""
    return subprocess.Popen(
        [*COMMAND, *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def assert_nothing_remains(group: int) -> None:
    """Wait until the process group is empty."""

    def empty() -> bool:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        return False

    try:
        until(empty, "nothing left", DEADLINE_S)
    except AssertionError:
        os.killpg(group, signal.SIGKILL)
        raise


def wait_for_rows(journal: Path) -> None:
    until(lambda: journal.exists() and journal.read_bytes().count(b"\n") >= 2, "rows", DEADLINE_S)


def test_ctrl_c_keeps_the_rows_of_a_study_and_leaves_no_process(write: Callable[..., Study], tmp_path: Path) -> None:
    write(TINY.replace("seeds = 3", "seeds = 500"), "Slow")
    process = start(tmp_path, "tiny.toml", "--out", "out.parquet", "--jobs", "2")
    wait_for_rows(tmp_path / "out.parquet.journal")
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    assert_nothing_remains(process.pid)
    kept = [row["seed"] for row in read_rows(tmp_path / "out.parquet")]
    assert 2 <= len(kept) < 500
    assert run_here(load_study(str(tmp_path / "tiny.toml")), tmp_path / "out.parquet", seeds=kept).ran == 0


def test_a_killed_study_leaves_no_process_and_its_rows_in_the_journal(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    write(TINY.replace("seeds = 3", "seeds = 500"), "Slow")
    process = start(tmp_path, "tiny.toml", "--out", "out.parquet", "--jobs", "2")
    wait_for_rows(tmp_path / "out.parquet.journal")
    process.kill()
    process.communicate(timeout=DEADLINE_S)
    assert_nothing_remains(process.pid)
    assert run_here(load_study(str(tmp_path / "tiny.toml")), tmp_path / "out.parquet", seeds=range(1, 3)).ran == 0


def test_study_prints_a_table_and_exits_with_the_status_of_its_trials(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    write(GRID + "[[paper.points]]\nat = { 'robots.count' = 1 }\nvalues = { cell_coverage_fraction = 0.9 }")
    process = start(tmp_path, "tiny.toml", "--jobs", "1")
    output, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, errors
    assert "cell_coverage_fraction" in output
    assert "-0.6500  OUTSIDE" in output
    assert (tmp_path / "runs" / "tiny.png").is_file()
    assert len(read_rows(tmp_path / "runs" / "tiny.parquet")) == 6

    write(TINY.replace("seeds = 3", "seeds = 8"), "Raises", name="raises")
    process = start(tmp_path, "raises.toml", "--jobs", "1")
    output, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 1, errors
    assert "x node 0 crashed at tick 3: ValueError: no luck" in output

    process = start(tmp_path, "raises.toml", "--set", "robots.count=0")
    output, errors = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, output) == (2, "")
    assert errors == "zwerm: raises.toml: --set robots.count=0: robots.count: expected >= 1, got 0\n"
