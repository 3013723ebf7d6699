"""Why programs of robots ended: tracebacks of controllers that raised, once for the same lines, and a line for all others."""

from collections.abc import Mapping
from textwrap import indent
from typing import Final

from rich.console import Console

from zwerm.run.result import RunResult

_NODES_MAX: Final = 10

# A text of a controller begins no line as Zwerm's own lines begin.
_INDENT: Final = "  "


def print_tracebacks(console: Console, tracebacks: Mapping[int, str]) -> None:
    """Print each different traceback once, with its first node and the others that raised at the same place."""
    for nodes in grouped(tracebacks):
        others = ", ".join(map(str, nodes[1 : _NODES_MAX + 1]))
        rest = ", ..." if len(nodes) > _NODES_MAX + 1 else ""
        more = f", and {len(nodes) - 1} more from the same line: {others}{rest}" if others else ""
        text = f"node {nodes[0]} raised{more}\n{indent(tracebacks[nodes[0]], _INDENT)}"
        console.print(text, markup=False, highlight=False, soft_wrap=True)


def print_crashes(console: Console, result: RunResult) -> None:
    """Print a line for each reason for which programs ended without a traceback, but for the reason of the whole run."""
    groups: dict[str, list[int]] = {}
    for node, reason in sorted(result.crash_reasons.items()):
        if node not in result.tracebacks:
            groups.setdefault(reason, []).append(node)
    others = [
        (reason, nodes) for reason, nodes in groups.items() if result.reason != f"node {nodes[0]} crashed at {reason}"
    ]
    for reason, nodes in others[:_NODES_MAX]:
        text = f"node {nodes[0]} crashed at {reason}{_and_more(nodes)}"
        console.print(text, markup=False, highlight=False, soft_wrap=True)
    if len(others) > _NODES_MAX:
        count = sum(len(nodes) for _, nodes in others[_NODES_MAX:])
        console.print(f"and {count} more programs ended", markup=False, highlight=False)


def _and_more(nodes: list[int]) -> str:
    """Return how many nodes follow the first, and the first of them, as the rest of a line."""
    others = ", ".join(map(str, nodes[1 : _NODES_MAX + 1]))
    return f", and {len(nodes) - 1} more: {others}{', ...' if len(nodes) > _NODES_MAX + 1 else ''}" if others else ""


def grouped(tracebacks: Mapping[int, str]) -> list[list[int]]:
    """Return the nodes whose errors have the same kind and came from the same lines, by their first node."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for node, text in sorted(tracebacks.items()):
        places = [line for line in text.splitlines() if line.startswith("  File ")]
        kind = next((line for line in text.splitlines() if line and not line.startswith((" ", "Traceback"))), "")
        groups.setdefault((kind.partition(":")[0], *places), []).append(node)
    return list(groups.values())
