"""Rows of a study are on the disk before they count as stored: they survive a loss of power."""

import errno
import io
import os
from pathlib import Path
from typing import Any

import pytest

from zwerm.study.rows import Rows, StorageError, read_rows
from zwerm.study.trial import Row


def row(seed: int) -> Row:
    return {"variant": "", "fingerprint": "f", "seed": seed, "outcome": "completed", "ticks": 1}


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """The files and folders that were synchronised with the disk, each with its size at that time."""
    found: list[tuple[str, int]] = []
    fsync = os.fsync

    def watched(descriptor: int) -> None:
        found.append((Path(f"/proc/self/fd/{descriptor}").readlink().name, os.fstat(descriptor).st_size))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", watched)
    return found


def test_each_row_is_on_the_disk_when_it_is_added(tmp_path: Path, synced: list[tuple[str, int]]) -> None:
    with Rows(tmp_path / "rows.parquet") as rows:
        assert [name for name, _ in synced] == [tmp_path.name], "the name of the journal"
        for seed in range(3):
            rows.add(row(seed))
            journal = tmp_path / "rows.parquet.journal"
            assert synced[-1] == (journal.name, journal.stat().st_size)
    assert len(synced) == 4
    with Rows(tmp_path / "rows.parquet") as again:
        assert sorted(key[2] for key in again.held) == [0, 1, 2]


def test_the_journal_is_deleted_only_when_the_file_and_its_name_are_on_the_disk(
    tmp_path: Path, synced: list[tuple[str, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, steps = tmp_path / "rows.parquet", []
    unlink, replace = Path.unlink, Path.replace
    monkeypatch.setattr(Path, "unlink", lambda self: (steps.append(("unlink", len(synced))), unlink(self))[1])
    monkeypatch.setattr(
        Path, "replace", lambda self, target: (steps.append(("replace", len(synced))), replace(self, target))[1]
    )
    with Rows(path) as rows:
        rows.add(row(1))
        synced.clear()
        rows.merge([])
    assert [name for name, _ in synced] == ["rows.parquet.new", tmp_path.name]
    assert synced[0][1] == path.stat().st_size, "the whole file"
    assert steps == [("replace", 1), ("unlink", 2)]
    assert [each["seed"] for each in read_rows(path)] == [1]


def test_a_journal_that_ends_within_a_row_loses_that_row_only(tmp_path: Path) -> None:
    path = tmp_path / "rows.parquet"
    with Rows(path) as rows:
        rows.add(row(1))
        rows.add(row(2))
    journal = tmp_path / "rows.parquet.journal"
    whole = journal.read_bytes()
    first = whole.index(b"\n") + 1
    for end in range(len(whole) + 1):
        journal.write_bytes(whole[:end])
        with Rows(path) as rows:
            assert sorted(key[2] for key in rows.held) == [1, 2][: (end >= first) + (end >= len(whole))]


class FullDisk:
    """A journal's file on a disk that takes `space` more bytes."""

    def __init__(self, file: io.FileIO, space: int) -> None:
        self._file, self._space = file, space

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def write(self, line: bytes) -> int:
        """Write what there is space for, as the system does; raise OSError where there is none."""
        if not self._space:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        taken, self._space = line[: self._space], max(0, self._space - len(line))
        return self._file.write(taken)


@pytest.mark.parametrize("space", [0, 10])
def test_a_full_disk_refuses_a_row_in_one_line_and_damages_none_before_it(tmp_path: Path, space: int) -> None:
    path = tmp_path / "rows.parquet"
    with Rows(path) as rows:
        rows.add(row(1))
        whole = rows._journal
        rows._journal = FullDisk(whole, space)  # type: ignore[assignment]
        with pytest.raises(
            StorageError, match=r"rows.parquet: cannot be written: No space left on device; the rows so"
        ):
            rows.add(row(2))
        rows._journal = whole
        rows.add(row(3))
    with Rows(path) as again:
        assert sorted(key[2] for key in again.held) == [1, 3]


def test_a_full_disk_at_the_end_keeps_the_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(table: object, path: Path) -> None:
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "Error writing bytes to file")

    path = tmp_path / "rows.parquet"
    with monkeypatch.context() as patched, Rows(path) as rows:
        patched.setattr("pyarrow.parquet.write_table", refuse)
        rows.add(row(1))
        with pytest.raises(StorageError, match=r"cannot be written: No space left on device"):
            rows.merge([])
    assert [each.name for each in tmp_path.iterdir()] == ["rows.parquet.journal"]
    with Rows(path) as again:
        again.merge([])
    assert [each["seed"] for each in read_rows(path)] == [1]
