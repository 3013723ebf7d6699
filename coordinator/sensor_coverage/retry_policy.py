"""How soon to say an order again, and how long to wait for its answer, by how much of what was said has got through.

While nothing was ever lost, an order is said again only when it takes unusually long: a perfect radio costs nothing. From the
first loss on it is said again after one way there and back. Whoever is silent is dead once so many attempts in a row cannot
all have been lost, one in a million aside; and not before a burst is over.
"""

import math
from typing import Final

# One way there and back [ticks], and how often somebody is asked who is on the way.
AGAIN_TICKS: Final = 2
BUSY_TICKS: Final = 8
# Where most is lost, orders follow each other without a pause.
MOST: Final = 0.6
# How many attempts in a row may be lost: bursts of 16 packets in the mean are over by then. And how many are enough.
BURST_TRIES: Final = 250
TRIES_MAX: Final = 2000
CHANCE: Final = 1e-6
# The older a loss, the less it says of the next: the weight of an order against the one after it.
FADING: Final = 0.995


class RetryPolicy:
    """What is known of how much gets lost."""

    def __init__(self) -> None:
        self.lossy = False
        self._said = self._missed = 0.0

    def note(self, attempts: int, heard: int) -> None:
        """Take note that an order was said so often, and heard so often."""
        self.lossy = self.lossy or heard < attempts
        self._said = FADING * self._said + attempts
        self._missed = FADING * self._missed + attempts - heard

    @property
    def lost_fraction(self) -> float:
        """The fraction of orders that get lost."""
        return self._missed / self._said if self._said else 0.0

    @property
    def again_ticks(self) -> int:
        """After how many ticks an order is said again."""
        return 1 if self.lost_fraction > MOST else AGAIN_TICKS

    @property
    def tries_max(self) -> int:
        """How many attempts in a row may stay without an answer before nobody is there."""
        if not self.lossy:
            return 0
        through = max((1.0 - self.lost_fraction) ** 2, 1e-4)
        return min(TRIES_MAX, max(BURST_TRIES, math.ceil(math.log(CHANCE) / math.log1p(-min(through, 0.99)))))
