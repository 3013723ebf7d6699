"""How many of the arcs that a slot knows its next occupant learns: the command with them has a greatest length."""

from collections.abc import Iterable
from typing import Final

from zwerm.agents.sensor_coverage.messages.pushes import ProvedArc

# Most arcs, and their greatest length in a message.
MEMORY_MAX: Final = 300
MEMORY_BYTES_MAX: Final = 45_000
# Greatest length of an arc and its triangle in a message, without its slots, and that of a slot.
ARC_BYTES: Final = 60
SLOT_BYTES: Final = 5


def remembered(arcs: tuple[ProvedArc, ...]) -> tuple[ProvedArc, ...]:
    """Return the arcs for a slot's next occupant: all, or of many those that rely on few slots."""
    if len(arcs) <= MEMORY_MAX and _bytes_of(arcs) <= MEMORY_BYTES_MAX:
        return arcs
    found = tuple(sorted(arcs, key=lambda each: len(each.needed) + len(each.seen))[:MEMORY_MAX])
    while _bytes_of(found) > MEMORY_BYTES_MAX:
        found = found[:-1]
    return found


def _bytes_of(arcs: Iterable[ProvedArc]) -> int:
    """Return the greatest length of arcs in a message."""
    return sum(ARC_BYTES + SLOT_BYTES * (len(each.needed) + len(each.seen)) for each in arcs)
