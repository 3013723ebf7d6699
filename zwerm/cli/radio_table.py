"""The radio's books on the terminal: for every channel its links, cause by cause, and what its nodes sent."""

from collections.abc import Mapping
from typing import Any, Final

from rich.console import Console
from rich.table import Table

Books = Mapping[str, Any]

_UNKNOWN: Final = "-"


def print_books(console: Console, radio: Books, links: int) -> None:
    """Print the books of every channel in `radio`, in all and of the `links` that lost most, and messages and bytes by node.

    "delivered %" is of the packets whose receivers were in reach, and so are losses.
    """
    for name, books in radio["channels"].items():
        causes = sorted(books["dropped"], key=lambda cause: (-books["dropped"][cause], cause))
        table = Table(title=f"channel {name}", title_justify="left", box=None, padding=(0, 2, 0, 0))
        for heading in (
            "from",
            "to",
            "sent",
            "delivered",
            *causes,
            "in flight",
            "delivered %",
            "age mean s",
            "age max s",
        ):
            table.add_column(heading, justify="right", overflow="fold")
        whole = [books["dropped"][cause] for cause in causes]
        table.add_row("all", "all", *_cells(books, whole), style="bold")
        for each in _worst(books["links"], causes, links) if books["links"] else ():
            table.add_row(str(each["sender"]), str(each["receiver"]), *_cells(each, each["causes"]))
        console.print(table)
        if not books["links"] and links:
            console.print("too many links to list: zwerm.run has their books")
        for what, unit in (("messages", "messages"), ("message_bytes", "bytes")):
            sent = books[what]
            mean = sum(sent) / len(sent) if sent else 0.0
            console.print(f"{unit} a node: mean {mean:,.1f}, most {max(sent, default=0):,}", highlight=False)


def _cells(books: Books, dropped: list[int]) -> list[str]:
    sent = books["sent"]
    in_reach = sent - books["out_of_reach"]
    share = f"{100.0 * books['delivered'] / in_reach:.1f}" if in_reach else _UNKNOWN
    ages = [_UNKNOWN if age is None else f"{age:.3g}" for age in (books["age_mean_s"], books["age_max_s"])]
    return [str(sent), str(books["delivered"]), *map(str, dropped), str(books["in_flight"]), share, *ages]


def _worst(columns: Books, causes: list[str], count: int) -> list[Books]:
    """Return the books of the `count` links that lost most, by sender and receiver."""
    rows = [
        {
            **{name: columns[name][row] for name in columns if name != "dropped"},
            "causes": [columns["dropped"].get(cause, [0] * (row + 1))[row] for cause in causes],
        }
        for row in range(len(columns["sender"]))
    ]
    rows.sort(key=lambda each: each["out_of_reach"] - sum(each["causes"]))
    return sorted(rows[:count], key=lambda each: (each["sender"], each["receiver"]))
