"""The rows of a study on disk: one Parquet file, and a journal of new rows while a study runs.

Each row is written to the journal when its trial ends, so it survives a crash of the process. `merge` replaces the file
atomically by one with all rows. One study at a time writes to a file.
"""

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterable, Sequence
from csv import writer as csv_writer
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from zwerm.errors import ScenarioError
from zwerm.study.study_tables import RESERVED
from zwerm.study.trial import Row

Key = tuple[str, str, int]

_TEXTS = ("study", "variant", "outcome", "reason", "trace", "fingerprint", "modules")
_FIRST = ("seed", "outcome", "reason", "trace", "fingerprint", "ticks", "sim_s", "wall_s")


def key_of(row: Row) -> Key:
    """Return the identity of a row's trial: variant, fingerprint of the scenario, seed."""
    return row["variant"], row["fingerprint"], row["seed"]


def read_rows(path: Path) -> list[Row]:
    """Return the rows of a Parquet file of results, without their empty fields.

    Raises ScenarioError if the file is not one.
    """
    try:
        rows = pq.read_table(path).to_pylist()
        for row in rows:
            key_of(row)
    except (pa.ArrowException, OSError, KeyError):
        raise ScenarioError([f"{path}: expected a Parquet file of a study's results"]) from None
    return [{name: value for name, value in row.items() if value is not None} for row in rows]


def export_csv(path: Path, csv: Path) -> Path:
    """Write the rows of a Parquet file as CSV, UTF-8 with one line of names, and return the path of the CSV file.

    Lists are JSON. Raises ScenarioError where the file cannot be written.
    """
    table = pq.read_table(path)
    names = table.column_names
    try:
        with csv.open("w", encoding="utf-8", newline="") as file:
            writer = csv_writer(file)
            writer.writerow(names)
            for row in table.to_pylist():
                values = (row[name] for name in names)
                writer.writerow(
                    [msgspec.json.encode(each).decode() if isinstance(each, list) else each for each in values]
                )
    except OSError as error:
        raise ScenarioError([f"{csv}: cannot be written: {error.strerror}"]) from None
    return csv


class StorageError(ScenarioError):
    """The disk does not take rows: it is full or read-only."""


class Rows:
    """The rows in `path` and in its journal, by key."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._journal_path = path.with_name(path.name + ".journal")
        self.held: dict[Key, Row] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._journal = self._journal_path.open("a+b", buffering=0)
            _sync(path.parent)  # the name of the journal: rows alone would be lost with it
        except OSError as error:
            raise ScenarioError([f"{path}: cannot be written: {error.strerror}"]) from None
        try:
            fcntl.flock(self._journal, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if path.exists():
                self.held = {key_of(row): row for row in read_rows(path)}
            self._replay()
        except BlockingIOError:
            self._journal.close()
            raise ScenarioError([f"{path}: another study is writing to it"]) from None
        except ScenarioError:
            self._journal.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._journal.close()

    def add(self, row: Row) -> None:
        """Store a row. Raises StorageError where the disk does not take it; the rows before it stay."""
        self.held[key_of(row)] = row  # first: an interrupt while the journal is written must not lose the row
        line, end = msgspec.json.encode(row) + b"\n", self._journal.seek(0, os.SEEK_END)
        try:
            if self._journal.write(line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self._journal.fileno())
        except OSError as error:
            with contextlib.suppress(OSError):
                self._journal.truncate(end)  # a row after half a line would make the journal unreadable
            raise self._not_written(error) from None

    def merge(self, axes: Sequence[str], superseded: Iterable[Key] = ()) -> None:
        """Write all rows except `superseded` to the Parquet file, the columns `axes` first, and delete the journal.

        Raises StorageError where the disk does not take the file: the file before it and the journal then stay.
        """
        for key in superseded:
            self.held.pop(key, None)
        rows = sorted(self.held.values(), key=lambda row: _order(row, axes))
        if rows:
            schema = _schema(rows, axes)
            fresh = self.path.with_name(self.path.name + ".new")
            table = pa.Table.from_pylist([_fitted(row, schema) for row in rows], schema)
            try:
                pq.write_table(table, fresh)
                _sync(fresh)
                fresh.replace(self.path)
                _sync(self.path.parent)
            except OSError as error:
                with contextlib.suppress(OSError):
                    fresh.unlink(missing_ok=True)
                raise self._not_written(error) from None
        self._journal_path.unlink()

    def _not_written(self, error: OSError) -> StorageError:
        why = os.strerror(error.errno) if error.errno else str(error)
        return StorageError(
            [
                f"{self.path}: cannot be written: {why}; the rows so far are kept, and the same command goes on from there"
            ]
        )

    def _replay(self) -> None:
        """Read the journal of an interrupted study; its last line may be incomplete."""
        self._journal.seek(0)
        text = self._journal.read()
        whole = text.rfind(b"\n") + 1
        try:
            rows: list[Row] = [msgspec.json.decode(line) for line in text[:whole].splitlines()]
            self.held |= {key_of(row): {k: v for k, v in row.items() if v is not None} for row in rows}
        except (msgspec.DecodeError, KeyError, TypeError, AttributeError):
            raise ScenarioError([f"{self._journal_path}: expected the journal of a study's results"]) from None
        if whole < len(text):
            self._journal.truncate(whole)


def _sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _order(row: Row, axes: Sequence[str]) -> tuple[Any, ...]:
    settings = tuple((axis in row, str(type(row.get(axis))), row.get(axis, 0)) for axis in axes)
    return row["variant"], settings, row["seed"], row["fingerprint"]


def _schema(rows: Sequence[Row], axes: Sequence[str]) -> pa.Schema:
    """Return the columns of all rows: identity, settings, outcome, metrics by name, then lists."""
    names = dict.fromkeys(name for row in rows for name in row)
    lists = [name for name in names if name == "cell_counts" or name.endswith(("_series", "series_time_s"))]
    known = dict.fromkeys(["study", "variant", *axes, *_FIRST])
    metrics = sorted(name for name in names if name not in known and name not in lists)
    columns = [*(name for name in known if name in names or name in RESERVED), *metrics, *lists]
    return pa.schema([(name, _type(name, [row[name] for row in rows if name in row])) for name in columns])


def _type(name: str, values: Sequence[Any]) -> pa.DataType:
    kinds = {type(value) for value in values}
    if name in _TEXTS:
        return pa.string()
    if name in ("seed", "ticks"):
        return pa.int64()
    if kinds == {list}:
        floats = any(isinstance(each, float) for value in values for each in value)
        return pa.list_(pa.float64() if floats else pa.int64())
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds <= {int, float} else pa.string()


def _fitted(row: Row, schema: pa.Schema) -> Row:
    """Return `row` with text in text columns, for settings whose type changed between two studies."""
    return {name: str(value) if pa.types.is_string(schema.field(name).type) else value for name, value in row.items()}
