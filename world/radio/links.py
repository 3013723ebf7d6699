"""Links: the pairs of nodes between which packets were ever sent, numbered in the order of their first packet.

Every property of a link (its ledger, the state of a burst, the key of its random numbers) is one row of an array. Up to
a few thousand nodes a dense table finds a link, beyond that a sorted one. The number of a link depends on the order of
sending, so no outcome may depend on it.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from zwerm.maths.keyed_random import Draws, gaussian, splitmix64, unit
from zwerm.world.scene import Floats, Ints

# Largest number of nodes with a dense table: 64 MB at most.
_DENSE_NODES_MAX: Final = 4_096
_FIRST_ROWS: Final = 64


class Column:
    """One value per link. `values` is replaced when the links grow: do not keep a reference to it."""

    def __init__(self, fill: float, kind: Any) -> None:
        self.fill = fill
        self.values: NDArray[Any] = np.full(_FIRST_ROWS, fill, dtype=kind)

    def grow(self, rows: int) -> None:
        """Make room for `rows` links."""
        grown = np.full(rows, self.fill, dtype=self.values.dtype)
        grown[: len(self.values)] = self.values
        self.values = grown


class Links:
    """The links among `nodes` nodes."""

    def __init__(self, nodes: int, dense_nodes_max: int = _DENSE_NODES_MAX) -> None:
        self.count = 0
        self._nodes = nodes
        self._dense: Ints | None = np.full(nodes * nodes, -1) if nodes <= dense_nodes_max else None
        self._sorted: Ints = np.zeros(0, dtype=np.int64)  # keys, ascending, where there is no dense table
        self._rows: Ints = np.zeros(0, dtype=np.int64)  # and the row of each
        self._columns: list[Column] = []
        self._sender = self.integers()
        self._receiver = self.integers()

    @property
    def sender(self) -> Ints:
        """The sender of each link, (count or more,)."""
        return self._sender.values

    @property
    def receiver(self) -> Ints:
        """The receiver of each link, (count or more,)."""
        return self._receiver.values

    def integers(self, fill: int = 0) -> Column:
        """Return a new column of integers."""
        return self._add(Column(fill, np.int64))

    def numbers(self, fill: float = 0.0) -> Column:
        """Return a new column of floats."""
        return self._add(Column(fill, np.float64))

    def words(self) -> Column:
        """Return a new column of 64-bit words."""
        return self._add(Column(0, np.uint64))

    def flags(self) -> Column:
        """Return a new column of booleans."""
        return self._add(Column(False, np.bool_))

    def rows(self, sender: Ints, receiver: Ints) -> Ints:
        """Return (k,) the row of each link (k,) senders to (k,) receivers; new links are added."""
        key = sender * self._nodes + receiver
        row = self._find(key)
        if (row < 0).any():
            self._append(np.unique(key[row < 0]))
            row = self._find(key)
        return row

    def find(self, sender: Ints, receiver: Ints) -> Ints:
        """Return (k,) the row of each link, -1 where there is none yet."""
        return self._find(sender * self._nodes + receiver)

    def _find(self, key: Ints) -> Ints:
        if self._dense is not None:
            return self._dense[key]
        if not self.count:
            return np.full(len(key), -1)
        place = np.minimum(np.searchsorted(self._sorted, key), self.count - 1)
        return np.where(self._sorted[place] == key, self._rows[place], -1)

    def _append(self, keys: Ints) -> None:
        rows = np.arange(self.count, self.count + len(keys))
        self.count += len(keys)
        if self.count > len(self.sender):
            for column in self._columns:
                column.grow(2 * self.count)
        self.sender[rows], self.receiver[rows] = np.divmod(keys, self._nodes)
        if self._dense is not None:
            self._dense[keys] = rows
            return
        place = np.searchsorted(self._sorted, keys)
        self._sorted = np.insert(self._sorted, place, keys)
        self._rows = np.insert(self._rows, place, rows)

    def _add(self, column: Column) -> Column:
        column.grow(max(_FIRST_ROWS, 2 * self.count))
        self._columns.append(column)
        return column


class LinkRandom:
    """Random numbers keyed by (purpose, sender, receiver, packet)."""

    def __init__(self, draws: Draws, purpose: str, links: Links) -> None:
        self._draws = draws
        self._purpose = purpose
        self._links = links
        self._known = 0
        self._states = links.words()

    def uniform(self, link: Ints, key: NDArray[np.uint64]) -> Floats:
        """Return random numbers (k,) in [0, 1) for the packets with these keys (k,) on links (k,)."""
        return unit(self.words(link, key))

    def normal(self, link: Ints, key: NDArray[np.uint64]) -> Floats:
        """Return standard normal random numbers (k,) for the packets with these keys (k,) on links (k,)."""
        return gaussian(self.words(link, key))

    def words(self, link: Ints, key: NDArray[np.uint64]) -> NDArray[np.uint64]:
        """Return 64-bit words (k,) for the packets with these keys (k,) on links (k,)."""
        links = self._links
        if self._known < links.count:
            new = slice(self._known, links.count)
            self._states.values[new] = self._draws.states(self._purpose, links.sender[new], links.receiver[new])
            self._known = links.count
        return splitmix64(splitmix64(self._states.values[link] ^ key))
