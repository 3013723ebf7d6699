"""Who is awake: the wake rule, which makes an idle robot cost nothing and is the same in every runner.

A node that gave no wake is observed at every tick. One that did sleeps until its time comes or one of its events happens:
a packet waits for it, its closed touch switches differ from those it last saw, or the ids it sees do. Contacts and ids are
compared whenever any robot moved, came or went.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from zwerm.wire.messages import Bearing, Contact, Wake
from zwerm.world.scene import Bools, Floats, Ints

NEVER: Final = math.inf


def _closed(reading: Sequence[Contact]) -> Any:
    return tuple(contact.bearing_rad for contact in reading)


def _ids(reading: Sequence[Bearing]) -> Any:
    return tuple(bearing.node for bearing in reading)


# What of a sensor's reading is an event when it changes, by the field of the observation.
SIGNATURES: Final[dict[str, Callable[[Any], Any]]] = {"touch": _closed, "bearings": _ids}


class Wakes:
    """The wake state of `count` nodes. Nobody is awake before it has been admitted."""

    def __init__(self, count: int, dt_s: float) -> None:
        self._dt_s = dt_s
        self._due: Floats = np.full(count, NEVER)  # the tick of the next observation
        self._on_packet: Bools = np.zeros(count, dtype=np.bool_)
        self._watching: dict[str, Bools] = {field: np.zeros(count, dtype=np.bool_) for field in SIGNATURES}
        self._newest: dict[str, dict[int, Any]] = {field: {} for field in SIGNATURES}  # readings
        self._unfiled: dict[str, tuple[Sequence[int], Sequence[Any]]] = {}  # the newest, of those observed together
        self._seen: dict[str, dict[int, Any]] = {field: {} for field in SIGNATURES}  # signatures, of those who watch
        self._asleep: dict[int, None] = {}
        self._ids: Ints = np.zeros(0, dtype=np.int64)
        self._stale = True

    def admit(self, node: int) -> None:
        """Let a node be observed at every tick, until it says otherwise."""
        self._due[node] = -1.0
        self._stale = True

    def retire(self, node: int) -> None:
        """Never wake this node again."""
        self._rouse(node)
        self._due[node] = NEVER
        self._stale = True

    def sleep(self, node: int, wake: Wake, tick: int) -> None:
        """Put a node to sleep until `wake`; a time that has passed means the next tick."""
        self._catch_up()
        due = NEVER if wake.at_s is None else float(np.ceil(wake.at_s / self._dt_s - 1e-9))
        self._due[node] = max(due, tick + 1)
        self._on_packet[node] = wake.on_packet
        for field, watching in (("touch", wake.on_contact), ("bearings", wake.on_visible)):
            self._watching[field][node] = watching
            if watching and node in self._newest[field]:
                self._seen[field][node] = SIGNATURES[field](self._newest[field][node])
        self._asleep[node] = None
        self._stale = True

    def note_packets(self, receivers: Sequence[int], tick: int) -> None:
        """Wake the sleepers among `receivers` that asked for packets."""
        for node in receivers:
            if self._on_packet[node]:
                self._due[node] = tick

    def watchers(self, field: str) -> Ints:
        """Return the sleepers that ask for a change of the sensor `field`."""
        return np.flatnonzero(self._watching[field])

    def note_readings(self, field: str, nodes: Ints, readings: Sequence[Any], tick: int) -> None:
        """Wake those of `nodes` whose reading differs from the one they last observed."""
        signature, seen = SIGNATURES[field], self._seen[field]
        for node, reading in zip(nodes.tolist(), readings, strict=True):
            if signature(reading) != seen.get(node):
                self._due[node] = tick

    def remember(self, field: str, nodes: Sequence[int], readings: Sequence[Any]) -> None:
        """Take note of what `nodes` observe now. As long as the same ones are awake that takes the place of what they had."""
        if field in self._unfiled and self._unfiled[field][0] != nodes:
            self._catch_up()
        self._unfiled[field] = nodes, readings

    def _catch_up(self) -> None:
        for field, (nodes, readings) in self._unfiled.items():
            self._newest[field].update(zip(nodes, readings, strict=True))
        self._unfiled.clear()

    def awake(self, tick: int) -> Ints:
        """Return the nodes to observe at `tick`, ascending; a sleeper among them is awake from now on."""
        if self._asleep or self._stale:
            self._ids = np.flatnonzero(self._due <= tick)
            self._stale = False
            for node in self._ids.tolist():
                if node in self._asleep:
                    self._rouse(node)
                    self._due[node] = -1.0
        return self._ids

    def _rouse(self, node: int) -> None:
        self._asleep.pop(node, None)
        self._on_packet[node] = False
        for watching in self._watching.values():
            watching[node] = False

    @property
    def sleeping(self) -> bool:
        """Tell whether anyone is asleep."""
        return bool(self._asleep)
