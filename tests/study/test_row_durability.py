"""Rows of a study are on the disk before they count as stored: they survive a loss of power."""

import os
from pathlib import Path

import pytest

from zwerm.study.rows import Rows, read_rows
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
