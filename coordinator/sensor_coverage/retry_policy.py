"""The times of repeated requests and the waiting times for answers, by the measured fraction of lost messages.

Before the first loss a request is repeated only when its answer is overdue: a perfect radio has no repetitions. After the
first loss it is repeated after one round trip. A silent robot is dead once its silence has a probability below CHANCE,
and not before a burst of losses has ended.
"""

import math
from typing import Final

# Ticks of one round trip, and between requests to a robot that has acknowledged.
REPEAT_TICKS: Final = 2
BUSY_TICKS: Final = 8
# Above this fraction of losses requests follow each other in every tick.
MOST_LOST: Final = 0.6
# Bounds of the consecutive attempts that may be lost. Bursts of 16 packets on average have ended after the first.
BURST_TRIES: Final = 250
TRIES_MAX: Final = 2000
CHANCE: Final = 1e-6
# Weight of a request relative to the next one in the measured fraction of losses.
FADING: Final = 0.995


class RetryPolicy:
    """The measured fraction of lost requests. `lossy`: a message was lost, ever."""

    def __init__(self) -> None:
        self.lossy = False
        self._sent = self._missed = 0.0

    def update(self, attempts: int, heard: int) -> None:
        """Record that a request was sent `attempts` times and received `heard` times."""
        self.lossy = self.lossy or heard < attempts
        self._sent = FADING * self._sent + attempts
        self._missed = FADING * self._missed + attempts - heard

    @property
    def lost_fraction(self) -> float:
        """The fraction of requests that get lost."""
        return self._missed / self._sent if self._sent else 0.0

    @property
    def repeat_ticks(self) -> int:
        """Ticks after which a request is repeated."""
        return 1 if self.lost_fraction > MOST_LOST else REPEAT_TICKS

    @property
    def tries_max(self) -> int:
        """Number of consecutive attempts without an answer before a robot counts as dead."""
        if not self.lossy:
            return 0
        through = max((1.0 - self.lost_fraction) ** 2, 1e-4)
        return min(TRIES_MAX, max(BURST_TRIES, math.ceil(math.log(CHANCE) / math.log1p(-min(through, 0.99)))))
