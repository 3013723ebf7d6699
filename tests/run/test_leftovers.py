"""Nothing is left behind: no process that a controller started, a readable recording after a kill, no long path that
fails."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Message
from mcap.stream_reader import StreamReader
from support import ROBOTS, ROOT, ZWERM, gone
from waiting import until


def start(folder: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    settings = ("--set", "time.duration_s=1e6", "--set", "robots.count=2", "--json")
    return subprocess.Popen(
        [sys.executable, *ZWERM, "run", "computation-free", *settings, *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": f"{ROOT}:{ROBOTS}"} | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def interrupt(running: subprocess.Popen[str]) -> None:
    running.send_signal(signal.SIGINT)


def kill_robots(running: subprocess.Popen[str]) -> None:
    """End the run as failing robots end it."""
    running.send_signal(signal.SIGTERM)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the kernel does not name the processes of a session")
@pytest.mark.parametrize("end", [interrupt, kill_robots])
def test_processes_that_a_controller_started_end_with_the_run(
    end: Callable[[subprocess.Popen[str]], None], tmp_path: Path
) -> None:
    forked = tmp_path / "forked"
    running = start(tmp_path, "--set", "robots.controller=ends:Forks", FORKED=str(forked))
    until(lambda: running.poll() is not None or (forked.exists() and forked.read_text()), "processes started")
    children = set(map(int, forked.read_text().split()))
    assert len(children) == 3
    assert not gone(children)
    end(running)
    running.communicate(timeout=60)
    assert running.returncode == 130
    until(lambda: gone(children), "what the controller started has ended")


def test_a_killed_run_leaves_a_recording_that_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    running = start(tmp_path, "--inline", "--record", str(path))
    until(lambda: running.poll() is not None or (path.exists() and path.stat().st_size > 200_000), "recorded")
    running.kill()
    running.communicate()
    count = 0
    with path.open("rb") as file:
        try:
            for record in StreamReader(file).records:
                count += isinstance(record, Message)
        except (EndOfFile, McapError):
            pass
    assert count > 1_000


def test_a_temporary_folder_with_a_long_path_works(tmp_path: Path) -> None:
    long = tmp_path / ("x" * 60) / ("y" * 60)
    long.mkdir(parents=True)
    ran = subprocess.run(
        [
            sys.executable,
            *ZWERM,
            "run",
            "computation-free",
            "--json",
            "--set",
            "time.duration_s=0.5",
            "--set",
            "robots.count=2",
        ],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": f"{ROOT}:{ROBOTS}", "TMPDIR": str(long)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ran.returncode == 0, ran.stderr
    assert list(long.iterdir()) == []
