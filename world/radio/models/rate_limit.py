"""Rate limit: the radio of a sender transmits `rate_bytes_s` and queues `queue_bytes`; it drops what does not fit.

The queue is first in, first out. Its drop-tail rule and its numbers are those of tc-tbf(8) with no burst. A
transmission with q bytes before it leaves the radio after (q + its size) / rate. A broadcast is transmitted once: the
radio sends or drops all its packets together. A transmission takes no time if earlier models dropped all its packets.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.types import NonNegative, Positive
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.radio.network_rules import SenderRate
from zwerm.world.scene import Floats


class RateTable(RadioModelTable):
    """The rate [bytes/s], and the capacity of the queue with the current transmission [bytes]."""

    rate_bytes_s: Positive
    queue_bytes: NonNegative


class RateLimit(RadioModel):
    """Delays packets in the queue of their sender, and drops packets that do not fit."""

    cause: ClassVar[str] = "queue-full"
    Parameters: ClassVar[type[RadioModelTable]] = RateTable
    example: ClassVar[Mapping[str, Any]] = {"rate_bytes_s": 60.0, "queue_bytes": 20.0}

    def __init__(self, parameters: RateTable, context: ModelContext) -> None:
        self._rate_bytes_s = parameters.rate_bytes_s
        self._queue_bytes = parameters.queue_bytes
        self._idle_at_s: Floats = np.zeros(context.nodes)  # end of the last queued transmission

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Queue each transmission once, in the order of sending."""
        number = len(sent.sender)
        on_air = np.zeros(number, dtype=np.bool_)
        on_air[packets.transmission] = True
        size = np.zeros(number)
        size[packets.transmission] = sent.sizes()[packets.payload]
        full = np.zeros(number, dtype=np.bool_)
        wait_s = np.zeros(number)
        now_s, rate = sent.scene.time_s, self._rate_bytes_s
        for rank in range(int(sent.rank.max()) + 1):
            rows = np.flatnonzero(on_air & (sent.rank == rank))
            sender = sent.sender[rows]
            start_s = np.maximum(self._idle_at_s[sender], now_s)
            done_s = start_s + size[rows] / rate
            # A millionth of a byte more, so that rounding drops no transmission that fits exactly.
            fits = (done_s - now_s) * rate <= self._queue_bytes + 1e-6
            self._idle_at_s[sender[fits]] = done_s[fits]
            full[rows] = ~fits
            wait_s[rows] = done_s - now_s
        drop = full[packets.transmission]
        return Verdict(drop, np.where(drop, 0.0, wait_s[packets.transmission]))

    @classmethod
    def network_rule(cls, parameters: RateTable) -> SenderRate:
        """Return a token bucket at the sender."""
        return SenderRate(parameters.rate_bytes_s, parameters.queue_bytes)
