"""The table of `zwerm twin`: the modelled and the real network side by side, for each transport."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

Comparison = Mapping[str, Any]


def print_twin(console: Console, title: str, found: Mapping[str, Comparison], skipped: Sequence[str]) -> None:
    """Print one column for the models and one for the network, for each transport of `found`."""
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    table.add_column("", style="bold", no_wrap=True)
    for transport in found:
        table.add_column(f"modelled ({transport} run)", justify="right")
        table.add_column(f"real, {transport.upper()}", justify="right")

    def row(name: str, model: str, real: str) -> None:
        cells = [cell for each in found.values() for cell in (_shown(each, model), _shown(each, real))]
        if any(cells):
            table.add_row(name, *cells)

    row("outcome", "", "outcome")
    row("packets sent", "modelled.sent", "real.sent")
    row("got through", "modelled.passed", "real.passed")
    row("fraction", "modelled.passed_fraction", "real.passed_fraction")
    row("difference", "", "difference")
    row("99 % within +-", "", "half_width")
    row("links that agree", "", "links_that_agree")
    row("agrees", "", "agrees")
    row("mean run of lost packets", "", "real.lost_run_mean_packets")
    row("heard after, mean (s)", "modelled.heard_after_mean_s", "real.heard_after_mean_s")
    for part in ("mean", "median", "p99", "max"):
        row(f"delay of the network, {part} (s)", "", f"real.delay_s.{part}")
    for cause in sorted({cause for each in found.values() for cause in each["modelled"]["dropped"]}):
        row(f"dropped: {cause}", f"modelled.dropped.{cause}", "")
    for rule in sorted({rule for each in found.values() for rule in each["real"]["dropped_ip_packets"]}):
        row(f"IP packets dropped: {rule}", "", f"real.dropped_ip_packets.{rule}")
    row("TCP segments", "", "real.tcp_segments")
    row("of them sent again", "", "real.tcp_segments_sent_again")
    row("late commands", "", "late_commands")
    console.print(table)
    for line in skipped:
        console.print(f"left out, here and there: {line}", markup=False, highlight=False, soft_wrap=True)


def _shown(found: Any, path: str) -> str:
    """Return the value at a dotted path as short text; an empty string if there is none."""
    for key in path.split(".") if path else ():
        found = found.get(key) if found is not None else None
    if not path or found is None:
        return ""
    if isinstance(found, bool):
        return "yes" if found else "no"
    return f"{found:.4g}" if isinstance(found, float) else str(found)
