"""Campaigns of runs that are carried out in parts: options, the loop over runs that are not stored yet, groups of rows."""

import argparse
import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

import msgspec

from benchmarks.common.csv_rows import add_csv_option, append_row, read_rows

CaseT = TypeVar("CaseT", bound=msgspec.Struct)


def add_campaign_options(parser: argparse.ArgumentParser, last_seed: int, settings: bool = True) -> None:
    """Add the options of every campaign; its seeds are 1 to `last_seed` by default. `settings` allows those of a scenario."""
    parser.add_argument("--seeds", type=int, nargs=2, default=[1, last_seed], metavar=("FIRST", "LAST"))
    if settings:
        parser.add_argument(
            "--set", action="append", default=[], metavar="PATH=VALUE", help="a setting of the scenario"
        )
    parser.add_argument("--rows", type=Path, metavar="FILE", help="store each run here, and skip runs that are stored")
    parser.add_argument("--minutes", type=float, help="begin no run after this processor time [min]")
    add_csv_option(parser)


def carry_out(
    asked: argparse.Namespace, cases: Iterable[CaseT], one_run: Callable[[CaseT], dict[str, str]]
) -> list[dict[str, str]]:
    """Carry out the runs that are not stored, store and print each, and return the rows of all.

    A row has a column for each field of its case.
    """
    rows = read_rows(asked.rows)
    for case in cases:
        if asked.minutes is not None and time.process_time() > 60.0 * asked.minutes:
            break
        wanted = msgspec.structs.asdict(case).items()
        if not any(wanted <= row.items() for row in rows):
            rows.append(one_run(case))
            append_row(asked.rows, rows[-1])
            print(*rows[-1].values(), sep="\t", flush=True)
    return rows


def grouped(rows: Sequence[dict[str, str]], *columns: str) -> dict[tuple[str, ...], list[dict[str, str]]]:
    """Return the rows by their values in some columns."""
    groups: dict[tuple[str, ...], list[dict[str, str]]] = {}
    for row in rows:
        groups.setdefault(tuple(row[each] for each in columns), []).append(row)
    return groups


def commit_of_copy() -> str:
    """Return the commit of this copy of the code, marked where files differ from it; "" outside a repository."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--exclude=*"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
