"""Tracebacks of controllers that raised: those from the same lines are printed once."""

from collections.abc import Mapping
from typing import Final

from rich.console import Console

_NODES_MAX: Final = 10


def print_tracebacks(console: Console, tracebacks: Mapping[int, str]) -> None:
    """Print each different traceback once, with its first node and the others that raised at the same place."""
    for nodes in grouped(tracebacks):
        others = ", ".join(map(str, nodes[1 : _NODES_MAX + 1]))
        rest = ", ..." if len(nodes) > _NODES_MAX + 1 else ""
        more = f", and {len(nodes) - 1} more from the same line: {others}{rest}" if others else ""
        text = f"node {nodes[0]} raised{more}\n{tracebacks[nodes[0]]}"
        console.print(text, markup=False, highlight=False, soft_wrap=True)


def grouped(tracebacks: Mapping[int, str]) -> list[list[int]]:
    """Return the nodes whose errors have the same kind and came from the same lines, by their first node."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for node, text in sorted(tracebacks.items()):
        places = [line for line in text.splitlines() if line.startswith("  File ")]
        kind = next((line for line in text.splitlines() if line and not line.startswith((" ", "Traceback"))), "")
        groups.setdefault((kind.partition(":")[0], *places), []).append(node)
    return list(groups.values())
