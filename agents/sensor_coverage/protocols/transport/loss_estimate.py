"""The share of its neighbours' messages that a robot misses, and the number of copies of its own that it sends for that.

Each sender numbers its broadcasts, and says how many copies it sends. A receiver counts the copies that arrive, and the
broadcasts between them that do not. Losses are nearly the same in both directions. So a robot sends enough copies that
the loss of all of them is rare. A radio without losses carries no copy.
"""

from typing import Final

COPIES_MAX: Final = 4
# A message has as many copies as make the loss of all of them rarer than this.
LOST_FRACTION_MAX: Final = 0.13
# Weight of an earlier packet in the estimate, for each later one, and packets before which there is no estimate.
MEMORY: Final = 0.98
PACKETS_MIN: Final = 6.0
# A longer gap between numbers means that the sender was out of range.
GAP_MAX: Final = 8


class LossEstimate:
    """One robot's estimate of the fraction of packets that are lost. `copies` is the number to send of each message."""

    def __init__(self) -> None:
        self.copies = 1
        self._newest: dict[int, int] = {}  # sender: number of its newest broadcast
        self._lost = 0.0
        self._packets = 0.0

    @property
    def fraction(self) -> float:
        """The fraction of packets that are lost, 0 before enough have arrived."""
        return self._lost / self._packets if self._packets >= PACKETS_MIN else 0.0

    def forget(self, sender: int) -> None:
        """Forget a sender that counts its broadcasts from the start again."""
        self._newest.pop(sender, None)

    def receive(self, sender: int, number: int, copies: int, arrived: int) -> None:
        """Record that `arrived` of the copies of a broadcast have arrived in one tick."""
        newest = self._newest.get(sender)
        if newest is not None and number <= newest:
            self._count(-min(arrived, copies), 0)  # late: it was counted as lost
            return
        self._newest[sender] = number
        gap = 0 if newest is None else number - newest - 1
        missed = gap * copies if gap <= GAP_MAX else 0
        self._count(missed + max(0, copies - arrived), missed + copies)

    def _count(self, lost: int, packets: int) -> None:
        kept = MEMORY**packets
        self._lost = max(0.0, self._lost * kept + lost)
        self._packets = self._packets * kept + packets
        fraction, copies = self.fraction, 1
        while copies < COPIES_MAX and fraction**copies > LOST_FRACTION_MAX:
            copies += 1
        self.copies = copies
