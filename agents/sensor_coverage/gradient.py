"""The way to the nearest frontier robot, hop by hop, from what neighbours say of their own way.

A distance vector with a sequence number for every root, and the feasibility condition of Babel (RFC 8966, section 2.4): a
neighbour is followed only if what it says is newer than all that this robot has said itself of that root, or as new and
nearer. With one root there is no loop at any time; with several, one that arises while robots change from root to root is
gone once word of each root has come around it. Nothing is believed for ever: what a neighbour said expires, and so does
what was promised, so any state, however wrong, is forgotten, and none counts further than the cap.

Promised is liveness under loss below 1, not that a distance is true at a given moment: it is as old as the way is long.
"""

from typing import Annotated, Final, NamedTuple

from msgspec import Meta, Struct

COUNT_MAX: Final = 2**62
Count = Annotated[int, Meta(ge=0, le=COUNT_MAX)]


class Advert(Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag="advert"):
    """How far the sender is from the nearest root that it knows of; `root` None: it knows of none.

    `number` counts the sender's adverts, `sequence` is the root's word for how new its own is.
    """

    number: Count
    root: Count | None
    sequence: Count
    distance: Annotated[float, Meta(ge=0.0)]


class _Heard(NamedTuple):
    """A neighbour's latest advert, the weight of the edge to it, and until when it is believed."""

    advert: Advert
    weight: float
    until_s: float


class _Promise(NamedTuple):
    """The newest and nearest that was ever said of a root: who follows this robot relies on it."""

    sequence: int
    distance: float
    until_s: float


class _Way(NamedTuple):
    """Ordered as ways are preferred: the shortest, and of equal ones that to the smallest ids."""

    distance: float
    root: int
    next_hop: int
    sequence: int


class Gradient:
    """One robot's distance to the nearest root, and the neighbour that is next on the way there.

    Distances above `cap` count as none. An advert is believed for `expiry_s`; it should be many intervals between adverts,
    or a few lost ones in a row cut the way. A root renews its sequence number every `renew_s` (`expiry_s` by default):
    more often than a word takes along one way and along the other, robots could stay on a way that is fast, but not
    shortest. `me` is this robot's id.
    """

    def __init__(self, me: int, cap: float, expiry_s: float, renew_s: float | None = None) -> None:
        self._me = me
        self._cap = cap
        self._expiry_s = expiry_s
        self._renew_s = expiry_s if renew_s is None else renew_s
        self._number = 0
        self._sequence = 0
        self._renew_at_s: float | None = None  # None while this robot is no root
        self._heard: dict[int, _Heard] = {}
        self._promised: dict[int, _Promise] = {}
        self._way: _Way | None = None

    @property
    def distance(self) -> float | None:
        """The weight of the way to the nearest root, as of the last call; 0 at a root, None where none is known of."""
        if self._renew_at_s is not None:
            return 0.0
        return self._way.distance if self._way is not None else None

    @property
    def root(self) -> int | None:
        """The root that the way leads to."""
        if self._renew_at_s is not None:
            return self._me
        return self._way.root if self._way is not None else None

    @property
    def next_hop(self) -> int | None:
        """The neighbour next on the way; None at a root, and where none is known of."""
        return self._way.next_hop if self._way is not None and self._renew_at_s is None else None

    def hear(self, sender: int, advert: Advert, weight: float, now_s: float) -> None:
        """Take in what a neighbour says, over an edge of this weight (at least 1). An old or repeated advert says nothing."""
        known = self._heard.get(sender)
        if known is not None and advert.number <= known.advert.number:
            return
        if advert.root == self._me and self._sequence <= advert.sequence < COUNT_MAX:
            # It is from before this robot lost its memory, or damaged: be newer, or nobody would believe this robot.
            self._sequence = advert.sequence + 1
        self._heard[sender] = _Heard(advert, weight, now_s + self._expiry_s)
        self._choose(now_s)

    def lose(self, neighbour: int, now_s: float) -> None:
        """Forget a neighbour that is none any more."""
        if self._heard.pop(neighbour, None) is not None:
            self._choose(now_s)

    def advert(self, now_s: float, is_root: bool) -> Advert:
        """Return what to tell all neighbours now. `is_root`: this robot is at the frontier itself."""
        self._number += 1
        self._heard = {sender: each for sender, each in self._heard.items() if now_s < each.until_s}
        self._promised = {root: each for root, each in self._promised.items() if now_s < each.until_s}
        if is_root:
            if self._renew_at_s is None or now_s >= self._renew_at_s:
                self._sequence += 1
                self._renew_at_s = now_s + self._renew_s
            return Advert(self._number, self._me, self._sequence, 0.0)
        self._renew_at_s = None
        self._choose(now_s)
        if self._way is None:
            return Advert(self._number, None, 0, 0.0)
        distance, root, _, sequence = self._way
        known = self._promised.get(root)
        if known is not None and known.sequence == sequence:
            distance = min(distance, known.distance)
        self._promised[root] = _Promise(sequence, distance, now_s + self._expiry_s)
        return Advert(self._number, root, sequence, self._way.distance)

    def _choose(self, now_s: float) -> None:
        ways = [
            _Way(each.advert.distance + each.weight, each.advert.root, sender, each.advert.sequence)
            for sender, each in self._heard.items()
            if now_s < each.until_s and each.advert.root is not None and self._feasible(each.advert, now_s)
        ]
        best = min(ways, default=None)
        self._way = best if best is not None and best.distance <= self._cap else None

    def _feasible(self, advert: Advert, now_s: float) -> bool:
        """Tell whether following the advert cannot lead back here."""
        if advert.root is None or advert.root == self._me:
            return False
        known = self._promised.get(advert.root)
        if known is None or now_s >= known.until_s:
            return True
        return (known.sequence, -known.distance) < (advert.sequence, -advert.distance)
