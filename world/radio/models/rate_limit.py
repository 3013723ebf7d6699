"""Rate limit: a sender's radio transmits `rate_bytes_s` and holds `queue_bytes` more; what does not fit is dropped.

The queue is served first come, first served; its drop-tail rule and its numbers are those of tc-tbf(8) with no burst: a
transmission that finds q bytes before it leaves the radio after (q + its size) / rate. A broadcast is transmitted once, and
all its packets share its fate. Transmissions of which an earlier model has left nothing take no time.
"""

from typing import ClassVar

import numpy as np

from zwerm.scenario.types import NonNegative, Positive
from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict
from zwerm.world.scene import Floats


class RateTable(LinkTable):
    """The rate [bytes/s], and the room in the queue, the transmission that is being sent included [bytes]."""

    rate_bytes_s: Positive
    queue_bytes: NonNegative


class RateLimit:
    """Delays what waits in a sender's queue, and drops what finds it full."""

    kind: ClassVar[str] = "rate_limit"
    cause: ClassVar[str] = "queue-full"
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = RateTable

    def __init__(self, parameters: RateTable, place: ModelPlace) -> None:
        self._rate_bytes_s = parameters.rate_bytes_s
        self._queue_bytes = parameters.queue_bytes
        self._idle_at_s: Floats = np.zeros(place.nodes)  # when the radio has sent all that it holds

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Queue each transmission once, those of one sender in the order of sending."""
        number = len(air.sender)
        on_air = np.zeros(number, dtype=np.bool_)
        on_air[packets.transmission] = True
        size = np.zeros(number)
        size[packets.transmission] = air.sizes()[packets.payload]
        full = np.zeros(number, dtype=np.bool_)
        wait_s = np.zeros(number)
        now_s, rate = air.scene.time_s, self._rate_bytes_s
        for rank in range(int(air.rank.max()) + 1):
            rows = np.flatnonzero(on_air & (air.rank == rank))
            sender = air.sender[rows]
            start_s = np.maximum(self._idle_at_s[sender], now_s)
            done_s = start_s + size[rows] / rate
            # A millionth of a byte: what fits exactly is not to be lost to rounding.
            fits = (done_s - now_s) * rate <= self._queue_bytes + 1e-6
            self._idle_at_s[sender[fits]] = done_s[fits]
            full[rows] = ~fits
            wait_s[rows] = done_s - now_s
        drop = full[packets.transmission]
        return Verdict(drop, np.where(drop, 0.0, wait_s[packets.transmission]))
