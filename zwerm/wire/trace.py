"""The trace: a hash chain over every observation and command in (tick, node) order.

Two runs with the same trace exchanged the same bytes with the same nodes at the same ticks. Each link of the chain is
BLAKE2b over the previous link, a frame and the tick's messages. The frame holds the tick, the node ids and the length
of every message. So no two ticks share their bytes.
"""

from collections.abc import Sequence
from hashlib import blake2b
from struct import pack
from typing import Final

DIGEST_BYTES: Final = 16


class Trace:
    """Accumulates the chain of one run."""

    def __init__(self, scenario: bytes = b"") -> None:
        self._link = blake2b(scenario, digest_size=DIGEST_BYTES).digest()
        self._newest: tuple[int, Sequence[int], Sequence[bytes], Sequence[bytes]] | None = None

    def extend(self, tick: int, nodes: Sequence[int], observations: Sequence[bytes], commands: Sequence[bytes]) -> None:
        """Chain one tick; the three sequences are parallel and ordered by node id. A node that gave none has b"".

        They must not change afterwards: the hash is computed in `catch_up`, or when it is needed.
        """
        self.catch_up()
        self._newest = tick, nodes, observations, commands

    def catch_up(self) -> None:
        """Compute the hash of the newest tick: best while the nodes work."""
        if self._newest is None:
            return
        tick, nodes, observations, commands = self._newest
        self._newest = None
        parts = [self._link, b"", *observations, *commands]
        count = len(nodes)
        parts[1] = pack(f"<QQ{count}Q{2 * count}I", tick, count, *nodes, *map(len, parts[2:]))
        self._link = blake2b(b"".join(parts), digest_size=DIGEST_BYTES).digest()

    def hex(self) -> str:
        """Return the newest link of the chain."""
        self.catch_up()
        return self._link.hex()
