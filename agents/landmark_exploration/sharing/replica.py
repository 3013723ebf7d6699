"""Append-only logs, one for each origin, and the version vector: the number of entries that are held of each log.

An origin is a robot in one of its incarnations, and only it appends to its log. So replicas merge by the longer of each
log, in any order and any number of times (a grow-only set; Shapiro et al. 2011). Replicas with equal vectors are equal.
This module does not read entries.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from zwerm.agents.landmark_exploration.sharing.mixing import mix

INCARNATIONS: Final = 256

# Approximate limit of entries of one log that wait for those before them.
WAITING_MAX: Final = 1_000

# Digests are below this.
DIGESTS: Final = 1 << 62


def origin_of(node: int, incarnation: int) -> int:
    """Return the origin of a robot in one of its incarnations."""
    return node * INCARNATIONS + incarnation % INCARNATIONS


class Stretch(NamedTuple):
    """Successive entries of one log, from entry number `first` on."""

    origin: int
    first: int
    entries: tuple[bytes, ...]


class Replica:
    """The known part of every log. `vector` maps an origin to the number of its entries that are held."""

    def __init__(self) -> None:
        self.logs: dict[int, list[bytes]] = {}
        self.vector: dict[int, int] = {}
        self.digest = 0
        self._waiting: dict[int, dict[int, bytes]] = {}  # by origin and number, entries after a gap

    def extend(self, stretch: Stretch) -> Sequence[bytes]:
        """Add the new entries of a stretch, and return all that were added. Entries after a gap wait until it is filled."""
        origin, first, entries = stretch
        held = self.vector.get(origin, 0)
        if first > held:
            waiting = self._waiting.setdefault(origin, {})
            if len(waiting) < WAITING_MAX:
                waiting.update(enumerate(entries, first))
            return ()
        new = list(entries[held - first :])
        if new:
            ahead = self._waiting.pop(origin, {})
            while held + len(new) in ahead:
                new.append(ahead[held + len(new)])
            later = {number: entry for number, entry in ahead.items() if number > held + len(new)}
            if later:
                self._waiting[origin] = later
            self.logs.setdefault(origin, []).extend(new)
            # The digest is a sum with one number for each (origin, count), so that an update is cheap.
            if held:
                self.digest -= mix(origin, held)
            self.vector[origin] = held + len(new)
            self.digest = (self.digest + mix(origin, held + len(new))) % DIGESTS
        return new

    def append(self, origin: int, entries: Sequence[bytes]) -> Stretch:
        """Add entries at the end of a log, and return them as a stretch."""
        stretch = Stretch(origin, self.vector.get(origin, 0), tuple(entries))
        self.extend(stretch)
        return stretch

    def missing(self, vector: Mapping[int, int], origins: Iterable[int], entries_max: int) -> list[Stretch]:
        """Return the entries of the logs of `origins` that the holder of `vector` lacks, at most `entries_max`."""
        found: list[Stretch] = []
        for origin in origins:
            first = vector.get(origin, 0)
            some = tuple(self.logs.get(origin, ())[first : first + entries_max])
            if some:
                found.append(Stretch(origin, first, some))
                entries_max -= len(some)
            if entries_max <= 0:
                break
        return found
