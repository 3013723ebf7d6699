"""Refused messages, counted by node and reason: of the link, which refuses strangers, and of the world, which refuses content.

The world's thread reads the counts while a thread of the transport adds to them: each read copies in one step.
"""

from collections import Counter
from collections.abc import Callable


class Refusals:
    """Counts refused messages. A node of -1 stands for a sender whose message names no node.

    `listener` is called with the node and the reason of each refused message, in the thread that counts it.
    """

    def __init__(self) -> None:
        self.listener: Callable[[int, str], object] | None = None
        self._reasons: dict[int, Counter[str]] = {}

    def count(self, node: int, reason: str) -> int:
        """Count one refused message of a node, and return the number of this node's."""
        reasons = self._reasons.setdefault(node, Counter())
        reasons[reason] += 1
        if self.listener is not None:
            self.listener(node, reason)
        return reasons.total()

    def of_node(self, node: int) -> int:
        """Return the number of refused messages of a node."""
        return self._reasons.get(node, Counter[str]()).total()

    @property
    def by_node(self) -> dict[int, dict[str, int]]:
        """The counts by node, ascending, and reason."""
        return {node: dict(reasons) for node, reasons in sorted(self._reasons.copy().items())}

    @property
    def by_reason(self) -> Counter[str]:
        """The counts of all nodes by reason."""
        total: Counter[str] = Counter()
        for reasons in self.by_node.values():
            total.update(reasons)
        return total

    def __or__(self, other: "Refusals") -> "Refusals":
        """Return the sum of both counts."""
        both = Refusals()
        for each in (self, other):
            for node, reasons in each.by_node.items():
                both._reasons.setdefault(node, Counter()).update(reasons)
        return both
