"""Wall segments as columns, and the point of a segment that is nearest to another point."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class Segments(NamedTuple):
    """Segments (m,): their first ends `px`, `py` [m], the ways `ex`, `ey` [m] to the others, and squared lengths [m²]."""

    px: Floats
    py: Floats
    ex: Floats
    ey: Floats
    length2: Floats

    @classmethod
    def of(cls, ends: Floats) -> Self:
        """Return the segments between `ends` (m, 4): x and y of both ends [m]. None may have a length of 0."""
        px, py, qx, qy = (np.ascontiguousarray(column) for column in ends.T)
        ex, ey = qx - px, qy - py
        return cls(px, py, ex, ey, ex**2 + ey**2)

    def nearest(self, x: Floats, y: Floats, which: Ints | slice) -> tuple[Floats, Floats]:
        """Return x and y [m] of the points nearest to `x`, `y` [m] on the segments `which`, which broadcast together."""
        px, py, ex, ey = self.px[which], self.py[which], self.ex[which], self.ey[which]
        # As np.clip, which is slower.
        along = np.minimum(np.maximum(((x - px) * ex + (y - py) * ey) / self.length2[which], 0.0), 1.0)
        return px + along * ex, py + along * ey

    def crossed(self, here: Floats, there: Floats) -> Bools:
        """Return (k,) which of the ways from `here` to `there` (k, 2) [m] cross a segment."""
        x, y = here[:, :1], here[:, 1:]
        vx, vy = there[:, :1] - x, there[:, 1:] - y
        across = vx * self.ey - vy * self.ex
        way = (self.px - x) * self.ey - (self.py - y) * self.ex  # times `across`: along the way, and along the segment
        along = (self.px - x) * vy - (self.py - y) * vx
        sign, size = np.sign(across), np.abs(across)
        met = (sign * way > 0.0) & (sign * way <= size) & (sign * along >= 0.0) & (sign * along <= size)
        crossed: Bools = np.logical_or.reduce(met & (size > 0.0), axis=1)
        return crossed
