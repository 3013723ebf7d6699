"""Private directories: removed by their own run, and after a kill by the next run on the machine."""

import fcntl
import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from support import ROOT

from zwerm.deploy.runtime_directory import private_directory, sweep
from zwerm.errors import LinkError

HOLDER = """
import os, signal, sys
from zwerm.deploy.runtime_directory import private_directory
with private_directory() as path:
    (path / "router").write_text("")
    print(path, flush=True)
    signal.pause()
"""


def test_the_directory_of_a_killed_run_is_removed_by_the_next_one_and_that_of_a_living_run_is_not(
    private_tmp: Path,
) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": str(private_tmp)}
    holders = [
        subprocess.Popen([sys.executable, "-c", HOLDER], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    try:
        killed, living = (Path(holder.stdout.readline().strip()) for holder in holders)
        holders[0].send_signal(signal.SIGKILL)
        holders[0].wait()
        assert killed.exists(), "a killed run removes nothing"
        with private_directory() as own:
            assert not killed.exists()
            assert living.exists()
            assert stat.S_IMODE(own.stat().st_mode) == 0o700
        assert not own.exists()
    finally:
        for holder in holders:
            holder.kill()
            holder.communicate()


def test_a_directory_that_is_being_made_is_not_taken_for_that_of_a_killed_run(tmp_path: Path) -> None:
    unfinished = tmp_path / "zwerm-new"
    unfinished.mkdir()
    (unfinished / ".held").write_text("")  # not locked yet, so not yet under its final name
    sweep(tmp_path)
    assert unfinished.exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may give a directory to another user")
def test_the_directory_of_another_user_is_not_removed(tmp_path: Path) -> None:
    path = tmp_path / "zwerm-other"
    path.mkdir()
    (path / "held").write_text("")
    os.chown(path, 61_000, 61_000)
    sweep(tmp_path)
    assert path.exists()
    os.chown(path, 0, 0)
    with (path / "held").open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        sweep(tmp_path)
        assert path.exists(), "a lock is held"
    sweep(tmp_path)
    assert not path.exists()


def test_a_temporary_folder_with_a_long_path_is_not_used_for_sockets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for length in (60, 78, 79, 80, 120, 200):
        monkeypatch.setattr("tempfile.tempdir", "/" + "x" * (length - 1))
        try:
            with private_directory() as path:
                assert len(str(path / "listener-12345678")) <= 100, length
        except FileNotFoundError:  # a short path is used, although no such folder exists here
            assert length < 79


def test_no_folder_for_temporary_files_is_an_error_of_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setattr("tempfile._candidate_tempdir_list", lambda: ["/proc/nobody"])
    expected = r"^No usable temporary directory .*: set TMPDIR to a folder that"
    with pytest.raises(LinkError, match=expected), private_directory():
        pass
