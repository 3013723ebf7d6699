"""Deployments that were tried and failed, by slot and side, because robots change their slots."""

from typing import Final

# Weight of a drive beside an edge relative to the next one, in the fraction of those that walls stopped.
FADING: Final = 0.9
# Sum of the weights below which too few of them are known.
DRIVES_MIN: Final = 4.0

# Names one side of an edge, or one gap around a slot.
Key = tuple[int, ...]


class AttemptLog:
    """Attempts by the key of what they would expand.

    A key in `closed` is not tried again. A (key, slot) in `failed` is not tried again from that slot. `blocked` has the
    directions [rad] in which a wall stopped a drive, by the slot where the drive began.
    """

    def __init__(self, attempts_max: int, near_wall_m: float, blocked: dict[int, list[float]] | None = None) -> None:
        self.closed: dict[Key, None] = {}
        self.failed: dict[tuple[Key, int], None] = {}
        self.attempts: dict[Key, int] = {}
        self.blocked: dict[int, list[float]] = {} if blocked is None else blocked
        self._drives = self._stopped = 0.0  # drives beside edges, and those of them that walls stopped, by weight
        self._attempts_max = attempts_max
        self._near_wall_m = near_wall_m

    def note_attempt(self, key: Key) -> None:
        """Count an attempt, and close the key after `attempts_max` of them."""
        self.attempts[key] = self.attempts.get(key, 0) + 1
        if key[2] != 0:
            self._drives, self._stopped = FADING * self._drives + 1.0, FADING * self._stopped
        if self.attempts[key] >= self._attempts_max:
            self.closed[key] = None

    def note_failure(self, key: Key, mover: int, direction_rad: float, driven_m: float) -> None:
        """Record that a wall stopped the mover after `driven_m`.

        One failure closes an edge's side. A failure within `near_wall_m` says nothing about the other end of the edge.
        """
        elsewhere = any((key, end) in self.failed for end in key[:2] if end != mover)
        if driven_m > self._near_wall_m or key[2] == 0 or elsewhere:
            self.closed[key] = None
        self._stopped += key[2] != 0
        self.failed[key, mover] = None
        self.blocked.setdefault(mover, []).append(direction_rad)

    @property
    def walls_stop_most(self) -> bool:
        """True if walls stopped more than a half of the latest drives beside edges: no regular lattice grows there."""
        return self._drives > DRIVES_MIN and self._stopped > 0.5 * self._drives

    def forget_gaps(self) -> None:
        """Forget the attempts at gaps, and that gaps are closed."""
        self.closed = {key: None for key in self.closed if key[2] != 0}
        self.attempts = {key: count for key, count in self.attempts.items() if key[2] != 0}
