"""Values of links that depend on the positions of both nodes only: computed once, and again after one of them moved.

A value is the same in both directions: the line is always from the smaller id to the larger.
"""

from collections.abc import Callable

import numpy as np

from zwerm.world.radio import Packets
from zwerm.world.radio.links import Links
from zwerm.world.scene import Floats, Ints, Scene


class StaticLinkValues:
    """The value of each link, by `measure` of positions (k, 2) to (k, 2) [m], which must be constant over a run."""

    def __init__(self, links: Links, measure: Callable[[Floats, Floats], Floats]) -> None:
        self._links = links
        self._measure = measure
        self._value = links.numbers()
        self._computed = links.integers(-1)  # number of moves of both nodes at that time
        self._position: Floats = np.zeros((0, 2))
        self._moves: Ints = np.zeros(0, dtype=np.int64)  # number of moves of each node

    def between(self, scene: Scene, packets: Packets) -> Floats:
        """Return (k,) the value of the link of each packet."""
        self._count_moves(scene)
        link, sender, receiver = packets.link, packets.sender, packets.receiver
        moves = self._moves[sender] + self._moves[receiver]  # neither decreases, so an equal sum means no move
        stale = np.flatnonzero(self._computed.values[link] != moves)
        if len(stale):
            self._compute(scene, link[stale], sender[stale], receiver[stale], moves[stale])
        value: Floats = self._value.values[link]
        return value

    def _count_moves(self, scene: Scene) -> None:
        if len(self._position) != len(scene.position):
            self._position = np.full(scene.position.shape, np.nan)
            self._moves = np.zeros(len(scene.position), dtype=np.int64)
        if self._position is not scene.position:
            self._moves += (scene.position != self._position).any(axis=1)
            self._position = scene.position

    def _compute(self, scene: Scene, link: Ints, sender: Ints, receiver: Ints, moves: Ints) -> None:
        """Compute each pair once: the second direction of a pair reuses the value of the first."""
        value, computed = self._value.values, self._computed.values
        upward = sender < receiver
        self._store(scene, link[upward], sender[upward], receiver[upward], moves[upward])
        link, sender, receiver, moves = link[~upward], sender[~upward], receiver[~upward], moves[~upward]
        other = self._links.find(receiver, sender)
        known = (other >= 0) & (computed[other] == moves)
        value[link[known]] = value[other[known]]
        computed[link[known]] = moves[known]
        self._store(scene, link[~known], receiver[~known], sender[~known], moves[~known])

    def _store(self, scene: Scene, link: Ints, start: Ints, end: Ints, moves: Ints) -> None:
        if len(link):
            self._value.values[link] = self._measure(scene.position[start], scene.position[end])
            self._computed.values[link] = moves
