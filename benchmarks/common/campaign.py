"""Campaigns of runs that are carried out in parts: their options, and the loop over the runs that are not stored yet."""

import argparse
import time
from collections.abc import Callable, Iterable
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
