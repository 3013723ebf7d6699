"""The rows that a benchmark measured, as a CSV file: the documentation shows these files as tables."""

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path


def add_csv_option(parser: argparse.ArgumentParser) -> None:
    """Add the option `--csv FILE`."""
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the rows to this file, too")


def write_csv(path: Path | None, rows: Sequence[dict[str, str]]) -> None:
    """Write rows, of which each has the same columns, to `path`; do nothing where it is None."""
    if path is None:
        return
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read_rows(path: Path | None) -> list[dict[str, str]]:
    """Return the rows that earlier parts of a campaign stored."""
    if path is None or not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def append_row(path: Path | None, row: dict[str, str]) -> None:
    """Add a row to the file of a campaign; do nothing where it is None."""
    if path is None:
        return
    new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(row), lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerow(row)
