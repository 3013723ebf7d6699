"""What holds between two places while both ends of a link stand still: asked once, and again when one has moved.

It is the same in both directions: the line is always drawn from the smaller id to the larger.
"""

from collections.abc import Callable

import numpy as np

from zwerm.world.radio import Packets
from zwerm.world.radio.links import Links
from zwerm.world.scene import Floats, Ints, Scene


class StaticLinkValues:
    """A number between two places (k, 2) to (k, 2) [m], the same in both directions and at every time."""

    def __init__(self, links: Links, measure: Callable[[Floats, Floats], Floats]) -> None:
        self._links = links
        self._measure = measure
        self._value = links.numbers()
        self._asked = links.integers(-1)  # for which moves of its two ends
        self._position: Floats = np.zeros((0, 2))
        self._moves: Ints = np.zeros(0, dtype=np.int64)  # how often each node has been found elsewhere

    def between(self, scene: Scene, packets: Packets) -> Floats:
        """Return (k,) the number between the ends of each packet's link."""
        self._look(scene)
        link, sender, receiver = packets.link, packets.sender, packets.receiver
        moves = self._moves[sender] + self._moves[receiver]  # neither ever decreases, so an equal sum is no move
        stale = np.flatnonzero(self._asked.values[link] != moves)
        if len(stale):
            self._ask(scene, link[stale], sender[stale], receiver[stale], moves[stale])
        value: Floats = self._value.values[link]
        return value

    def _look(self, scene: Scene) -> None:
        if len(self._position) != len(scene.position):
            self._position = np.full(scene.position.shape, np.nan)
            self._moves = np.zeros(len(scene.position), dtype=np.int64)
        if self._position is not scene.position:
            self._moves += (scene.position != self._position).any(axis=1)
            self._position = scene.position

    def _ask(self, scene: Scene, link: Ints, sender: Ints, receiver: Ints, moves: Ints) -> None:
        """Measure anew, each pair once; the other direction of a pair takes what has been found for it, if it has."""
        value, asked = self._value.values, self._asked.values
        upward = sender < receiver
        self._store(scene, link[upward], sender[upward], receiver[upward], moves[upward])
        link, sender, receiver, moves = link[~upward], sender[~upward], receiver[~upward], moves[~upward]
        other = self._links.find(receiver, sender)
        known = (other >= 0) & (asked[other] == moves)
        value[link[known]] = value[other[known]]
        asked[link[known]] = moves[known]
        self._store(scene, link[~known], receiver[~known], sender[~known], moves[~known])

    def _store(self, scene: Scene, link: Ints, start: Ints, end: Ints, moves: Ints) -> None:
        if len(link):
            self._value.values[link] = self._measure(scene.position[start], scene.position[end])
            self._asked.values[link] = moves
