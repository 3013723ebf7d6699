"""The result of a run is printed complete and alone, also when a file cannot be written."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import zwerm
from support import ROBOTS, ZWERM
from waiting import until

SHORT = ("--set", "time.duration_s=1", "--set", "robots.count=3")
MCAP_END = b"\x89MCAP0\r\n"


def test_the_json_object_is_printed_although_the_disk_is_full(tmp_path: Path) -> None:
    for name in ("full.png", "full.mcap"):
        (tmp_path / name).symlink_to("/dev/full")
    ran = zwerm(
        "run",
        "computation-free",
        "--inline",
        "--json",
        *SHORT,
        "--picture",
        "full.png",
        "--record",
        "full.mcap",
        cwd=tmp_path,
    )
    assert ran.returncode == 2
    assert json.loads(ran.stdout)["outcome"] == "time-limit"
    assert "zwerm: full.mcap: the recording is incomplete: No space left on device" in ran.stderr
    assert "zwerm: full.png: " in ran.stderr
    assert "Traceback" not in ran.stderr


@pytest.mark.parametrize("runner", ["--inline", "--processes"])
def test_the_output_of_a_controller_does_not_change_the_json_object(tmp_path: Path, runner: str) -> None:
    for name in ("ends.py",):
        (tmp_path / name).write_text((ROBOTS / name).read_text())
    ran = zwerm(
        "run", "computation-free", runner, "--json", *SHORT, "--set", "robots.controller=ends:Prints", cwd=tmp_path
    )
    assert json.loads(ran.stdout)["outcome"] == "time-limit"
    prefix = "" if runner == "--inline" else "node 2: "
    assert f"{prefix}I am 2" in ran.stderr.splitlines()


def test_the_result_is_printed_although_a_hang_up_comes_while_robots_leave(tmp_path: Path) -> None:
    (tmp_path / "ends.py").write_text((ROBOTS / "ends.py").read_text())
    record = tmp_path / "run.mcap"
    arguments = ["run", "computation-free", "--json", *SHORT, "--set", "robots.controller=ends:Lingers"]
    with subprocess.Popen(
        [sys.executable, *ZWERM, *arguments, "--record", str(record)],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),  # `nohup` ignores it, also for its children
    ) as running:
        until(lambda: record.exists() and record.read_bytes()[99:].endswith(MCAP_END), "the run ends")
        running.send_signal(signal.SIGHUP)
        out, said = running.communicate(timeout=30.0)
    assert running.returncode == 130
    found = json.loads(out)
    assert (found["outcome"], found["ticks"], len(found["trace"])) == ("interrupted", 10, 32)
    assert "interrupted while the robots left, after tick 10" in said


def test_the_credentials_never_replace_a_file_that_exists(tmp_path: Path) -> None:
    mine = tmp_path / "thesis.tex"
    mine.write_text("years of work")
    ran = zwerm(
        "world", "computation-free", *SHORT, "--listen", "tcp/127.0.0.1:0", "--credentials", str(mine), cwd=tmp_path
    )
    assert ran.returncode == 2
    assert f"zwerm: {mine}: cannot write credentials: File exists" in ran.stderr
    assert mine.read_text() == "years of work"


@pytest.mark.parametrize("command", ["study", "compare"])
def test_the_results_of_a_study_are_printed_although_its_picture_and_its_csv_cannot_be_written(
    tmp_path: Path, command: str
) -> None:
    (tmp_path / "rows.png").symlink_to("/dev/full")
    (tmp_path / "rows.csv").symlink_to("/dev/full")
    (tmp_path / "small.toml").write_text(
        'scenario = "computation-free"\nset = ["time.duration_s=0.3"]\nseeds = 1\nmetrics = ["area_coverage_fraction"]\n'
    )
    more = ("small.toml",) if command == "study" else ("computation-free", "--variant", "a", "--variant", "b", *SHORT)
    ran = zwerm(command, *more, "--seeds", "1", "--jobs", "1", "--out", "rows.csv", cwd=tmp_path)
    assert ran.returncode == 2
    assert "area_coverage_fraction" in ran.stdout
    assert "zwerm: rows.png: " in ran.stderr
    assert "zwerm: rows.csv: cannot be written: No space left on device" in ran.stderr
    assert "Traceback" not in ran.stderr
