"""The radio's ledger as tables: for each channel the links, with packets by cause of loss, and what each node sent."""

from collections.abc import Mapping
from typing import Any, Final

from rich.console import Console
from rich.table import Table

Ledger = Mapping[str, Any]

_UNKNOWN: Final = "-"
_COLUMNS_BEFORE: Final = ("from", "to", "sent", "delivered")
_COLUMNS_AFTER: Final = ("in flight", "delivered %", "age mean s", "age max s")


def print_radio_ledger(console: Console, radio: Ledger, links: int) -> None:
    """Print each channel of `radio`: its totals, the `links` links with most losses, and messages and bytes per node.

    "delivered %" is the percentage of the packets whose receivers were in reach.
    """
    for name, channel in radio["channels"].items():
        causes = sorted(channel["dropped"], key=lambda cause: (-channel["dropped"][cause], cause))
        table = Table(title=f"channel {name}", title_justify="left", box=None, padding=(0, 2, 0, 0))
        for heading in (*_COLUMNS_BEFORE, *causes, *_COLUMNS_AFTER):
            table.add_column(heading, justify="right", overflow="fold")
        totals = [channel["dropped"][cause] for cause in causes]
        table.add_row("all", "all", *_cells(channel, totals), style="bold")
        for each in _worst_links(channel["links"], causes, links) if channel["links"] else ():
            table.add_row(str(each["sender"]), str(each["receiver"]), *_cells(each, each["causes"]))
        console.print(table)
        if not channel["links"] and links:
            console.print("too many links to list: zwerm.run has their ledgers")
        for key, unit in (("messages", "messages"), ("message_bytes", "bytes")):
            sent = channel[key]
            mean = sum(sent) / len(sent) if sent else 0.0
            console.print(f"{unit} a node: mean {mean:,.1f}, most {max(sent, default=0):,}", highlight=False)


def _cells(ledger: Ledger, dropped: list[int]) -> list[str]:
    sent = ledger["sent"]
    in_reach = sent - ledger["out_of_reach"]
    percentage = f"{100.0 * ledger['delivered'] / in_reach:.1f}" if in_reach else _UNKNOWN
    ages = [_UNKNOWN if age is None else f"{age:.3g}" for age in (ledger["age_mean_s"], ledger["age_max_s"])]
    return [str(sent), str(ledger["delivered"]), *map(str, dropped), str(ledger["in_flight"]), percentage, *ages]


def _worst_links(columns: Ledger, causes: list[str], count: int) -> list[Ledger]:
    """Return the ledgers of the `count` links with most losses in reach, sorted by sender and receiver."""
    rows = [
        {
            **{name: columns[name][row] for name in columns if name != "dropped"},
            "causes": [columns["dropped"].get(cause, [0] * (row + 1))[row] for cause in causes],
        }
        for row in range(len(columns["sender"]))
    ]
    rows.sort(key=lambda each: each["out_of_reach"] - sum(each["causes"]))
    return sorted(rows[:count], key=lambda each: (each["sender"], each["receiver"]))
