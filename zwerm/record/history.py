"""The history of a run: a thinned record of the robots' positions, from which pictures are drawn.

Memory is bounded. When more than `held_max` samples are held, every second one is dropped, and from then on only every
second one is taken. So the samples stay evenly spaced over the whole run. The first and the newest sample are always
there. A history is for pictures; nothing in a run depends on it.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from zwerm.world.scene import Bools, Floats

HELD_MAX: Final = 2_000
ROOM_MIN: Final = 64


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
    """Samples of one run, appended at even intervals; the last may come early.

    Samples are rows of a few blocks, which are thinned in place. Arrays of their own would leave holes in the memory of a
    process that runs for hours.
    """

    def __init__(self, held_max: int = HELD_MAX) -> None:
        self._held_max = held_max
        self._stride = 1
        self._seen = 0
        self._held = 0
        self._blocks: tuple[NDArray[Any], ...] = ()  # as the fields of `Tracks`
        self._newest: HistorySample | None = None  # where it is not among the samples held

    def __len__(self) -> int:
        """Return the number of samples that `arrays` gives."""
        return self._held + (self._newest is not None)

    def append(self, moment: SceneLike, dead: Sequence[int] = ()) -> None:
        """Copy `moment` and the dead robots at that time; ids above those of the robots are ignored."""
        robots = len(moment.present)
        down: NDArray[np.bool_] | bool = False  # of all robots, mostly
        if dead:
            down = np.zeros(robots, dtype=np.bool_)
            down[[robot for robot in dead if robot < robots]] = True
        is_held = self._seen % self._stride == 0
        self._seen += 1
        if not is_held:
            self._newest = HistorySample(
                moment.time_s,
                moment.position.copy(),
                moment.heading.copy(),
                moment.present.copy(),
                np.broadcast_to(down, robots),
            )
            return
        self._newest = None
        if not self._blocks or self._held == len(self._blocks[0]):
            self._grow(robots)
        values = (moment.time_s, moment.position, moment.heading, moment.present, down)
        for block, value in zip(self._blocks, values, strict=True):
            block[self._held] = value
        self._held += 1
        if self._held > self._held_max:
            self._thin()

    def arrays(self) -> Tracks:
        """Return copies of the samples held, the oldest first.

        Raises ValueError if no sample was appended.
        """
        if not self._blocks:
            raise ValueError("the history is empty")
        held = [block[: self._held].copy() for block in self._blocks]
        if self._newest is not None:
            held = [np.append(block, [value], axis=0) for block, value in zip(held, self._newest, strict=True)]
        return Tracks(*held)

    def _grow(self, robots: int) -> None:
        """Double the room for samples, up to one more than may be held."""
        room = min(max(ROOM_MIN, 2 * self._held), self._held_max + 1)
        shapes = ((), (robots, 2), (robots,), (robots,), (robots,))
        types = (np.float64, np.float64, np.float64, np.bool_, np.bool_)
        grown: tuple[NDArray[Any], ...] = tuple(
            np.empty((room, *shape), dtype) for shape, dtype in zip(shapes, types, strict=True)
        )
        for block, before in zip(grown, self._blocks, strict=False):
            block[: self._held] = before
        self._blocks = grown

    def _thin(self) -> None:
        """Drop every second sample, and take every second one from now on. A newest one that is dropped is kept apart."""
        last, kept = self._held - 1, (self._held + 1) // 2
        if last % 2:
            self._newest = HistorySample(*(block[last].copy() for block in self._blocks))
        for block in self._blocks:
            block[:kept] = block[: self._held : 2]
        self._held = kept
        self._stride *= 2
