"""What holds between two places while both ends of a link stand still: asked once, and again when one has moved."""

from collections.abc import Callable

import numpy as np

from zwerm.world.radio import Packets
from zwerm.world.radio.links import Links
from zwerm.world.scene import Floats, Scene


class Standing:
    """A number between two places (k, 2) to (k, 2) [m], the same in both directions and at every time."""

    def __init__(self, links: Links, measure: Callable[[Floats, Floats], Floats]) -> None:
        self._measure = measure
        self._value = links.numbers()
        self._ends = [links.numbers(np.nan) for _ in range(4)]

    def between(self, scene: Scene, packets: Packets) -> Floats:
        """Return (k,) the number between the ends of each packet's link."""
        link = packets.link
        start, end = scene.position[packets.sender], scene.position[packets.receiver]
        places = (start[:, 0], start[:, 1], end[:, 0], end[:, 1])
        moved = np.zeros(len(link), dtype=np.bool_)
        for column, place in zip(self._ends, places, strict=True):
            moved |= column.values[link] != place
        if moved.any():
            new = link[moved]
            self._value.values[new] = self._measure(start[moved], end[moved])
            for column, place in zip(self._ends, places, strict=True):
                column.values[new] = place[moved]
        value: Floats = self._value.values[link]
        return value
