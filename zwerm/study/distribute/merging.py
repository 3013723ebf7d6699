"""Unite the rows of several files of a study: those of its shards, or of any parts of it that ran elsewhere."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from zwerm.errors import ScenarioError
from zwerm.study.rows import Rows, key_of, read_rows
from zwerm.study.trial import Row
from zwerm.world.tick.completion import FAILED

# Columns that differ between two runs of one trial.
_PASSING: Final = ("wall_s", "reason")


def merge_files(parts: Sequence[Path], out: Path) -> int:
    """Write the rows of `parts`, and those that `out` has, to `out`, and return the number of its rows.

    A trial that several files have is written once; a failed one only if no file has its result. Rows in the journal of a
    shard that was killed are taken too. Raises ScenarioError where a file has no results, is being written, or has
    another result of a trial than an earlier file.
    """
    if any(path.resolve() == out.resolve() for path in parts):
        raise ScenarioError([f"{out}: expected parts other than --out"])
    with Rows(out) as rows:
        held = rows.held
        origin = dict.fromkeys(held, out)
        for path in parts:
            for row in _rows_of(path):
                key = key_of(row)
                if key not in held or held[key]["outcome"] == FAILED:
                    held[key], origin[key] = row, path
                elif row["outcome"] != FAILED and _lasting(held[key]) != _lasting(row):
                    trial = ", ".join(filter(None, [row["variant"], f"seed {row['seed']}"]))
                    raise ScenarioError([f"{path}: {trial}: expected the result that {origin[key]} has, got another"])
        rows.merge(())
        return len(held)


def _rows_of(path: Path) -> list[Row]:
    """Return the rows of a file and of its journal, which stays where it is."""
    journal = path.with_name(path.name + ".journal")
    if not journal.exists():
        if not path.exists():
            raise ScenarioError([f"{path}: expected a file of a study's results; there is none"])
        return read_rows(path)
    with Rows(path) as rows:  # refuses a file that a study is writing
        return list(rows.held.values())


def _lasting(row: Row) -> Row:
    return {name: value for name, value in row.items() if name not in _PASSING}
