"""The history of a run: a thinned record of the robots' positions, from which pictures are drawn.

Memory is bounded. When more than `held_max` samples are held, every second one is dropped, and from then on only every
second one is taken. So the samples stay evenly spaced over the whole run. The first and the newest sample are always
there. A history is for pictures; nothing in a run depends on it.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from zwerm.world.scene import Bools, Floats

HELD_MAX: Final = 2_000


class SceneLike(Protocol):
    """The part of a scene that a history stores."""

    @property
    def time_s(self) -> float:
        """Virtual time [s]."""

    @property
    def position(self) -> Floats:
        """(n, 2) [m]."""

    @property
    def heading(self) -> Floats:
        """(n,) [rad]."""

    @property
    def present(self) -> Bools:
        """(n,) whether the robot is a body in the arena; otherwise its position has no meaning."""


class HistorySample(NamedTuple):
    """One moment, kept."""

    time_s: float
    position: Floats
    heading: Floats
    present: Bools
    dead: Bools


class Tracks(NamedTuple):
    """A history as arrays over k samples of n robots."""

    time_s: Floats  # (k,) [s]
    position: Floats  # (k, n, 2) [m]
    heading: Floats  # (k, n) [rad]
    present: NDArray[np.bool_]  # (k, n)
    dead: NDArray[np.bool_]  # (k, n) down for good; the body of one that is present stands where it died

    def until(self, time_s: float) -> Self:
        """Return the samples up to a time [s], copied."""
        last = int(np.searchsorted(self.time_s, time_s + 1e-9, side="right"))
        return type(self)(
            self.time_s[:last].copy(),
            self.position[:last].copy(),
            self.heading[:last].copy(),
            self.present[:last].copy(),
            self.dead[:last].copy(),
        )


class History:
    """Samples of one run, appended at even intervals; the last may come early."""

    def __init__(self, held_max: int = HELD_MAX) -> None:
        self._held_max = held_max
        self._stride = 1
        self._seen = 0
        self._held: list[HistorySample] = []
        self._newest: HistorySample | None = None

    def __len__(self) -> int:
        """Return the number of samples that `arrays` gives."""
        return len(self._samples())

    def append(self, moment: SceneLike, dead: Sequence[int] = ()) -> None:
        """Copy `moment` and the dead robots at that time; ids above those of the robots are ignored."""
        down = np.zeros(len(moment.present), dtype=np.bool_)
        down[[robot for robot in dead if robot < len(down)]] = True
        sample = HistorySample(
            moment.time_s, moment.position.copy(), moment.heading.copy(), moment.present.copy(), down
        )
        if self._seen % self._stride == 0:
            self._held.append(sample)
        self._seen += 1
        self._newest = sample
        if len(self._held) > self._held_max:
            self._held = self._held[::2]
            self._stride *= 2

    def arrays(self) -> Tracks:
        """Return the samples held, the oldest first.

        Raises ValueError if no sample was appended.
        """
        samples = self._samples()
        if not samples:
            raise ValueError("the history is empty")
        time_s, *arrays = zip(*samples, strict=True)
        return Tracks(np.array(time_s), *map(np.stack, arrays))

    def _samples(self) -> list[HistorySample]:
        if self._newest is None or self._held[-1] is self._newest:
            return self._held
        return [*self._held, self._newest]
