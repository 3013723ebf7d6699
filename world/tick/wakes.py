"""Wake rule: which nodes are observed at a tick. It is the same in every runner, and a sleeping robot costs no time.

A node that gave no wake is observed at every tick. A node with a wake sleeps until its time comes or one of its events
happens. Events are a packet for it, and a sensor reading that differs from the last one it observed. A sensor states
its event (`Sensor.wake_event`, `Sensor.signature`): touch, a change of the closed switches; bearings, of the ids in
sight. Readings are compared after every tick at which any robot moved, entered or left; where a sensor states a reach, a
sleeper with nothing to sense is left out until it moves, or a body in reach does.
"""

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from zwerm.wire.messages import Wake
from zwerm.world.scene import Bools, Floats, Ints

NEVER: Final = math.inf


class WakeEvent(NamedTuple):
    """The event of one sensor: the field of `Wake` that requests it, and the part of a reading that changes.

    `rest` is that part where there is nothing to sense.
    """

    asked_by: str
    signature: Callable[[Any], Hashable]
    rest: Hashable


class Wakes:
    """The wake state of `count` nodes. No node is awake before `admit`.

    `events` are the sensors' wake events, by the field of the observation.
    """

    def __init__(self, count: int, dt_s: float, events: Mapping[str, WakeEvent]) -> None:
        self.events = dict(events)
        self._dt_s = dt_s
        self._due: Floats = np.full(count, NEVER)  # the tick of the next observation
        self._on_packet: Bools = np.zeros(count, dtype=np.bool_)
        self._watched = dict.fromkeys(self.events, 0)  # the number of nodes in each column of `_watching`
        self._watching: dict[str, Bools] = {field: np.zeros(count, dtype=np.bool_) for field in self.events}
        self._newest: dict[str, dict[int, Any]] = {field: {} for field in self.events}  # readings
        self._unmerged: dict[str, tuple[Sequence[int], Sequence[Any]]] = {}  # the newest of all nodes observed together
        self._seen: dict[str, dict[int, Any]] = {field: {} for field in self.events}  # signatures of watching nodes
        # Sleepers with nothing to sense, compared at least once since they sleep.
        self._at_rest: dict[str, Bools] = {field: np.zeros(count, dtype=np.bool_) for field in self.events}
        self._asleep: dict[int, None] = {}
        self._ids: Ints = np.zeros(0, dtype=np.int64)
        self._stale = True

    def admit(self, node: int) -> None:
        """Observe a node at every tick, until it gives a wake."""
        self._due[node] = -1.0
        self._stale = True

    def retire(self, node: int) -> None:
        """Stop observing a node."""
        self._rouse(node)
        self._due[node] = NEVER
        self._stale = True

    def sleep(self, node: int, wake: Wake, tick: int) -> None:
        """Let a node sleep until `wake`; a time in the past means the next tick."""
        self._catch_up()
        due = NEVER if wake.at_s is None else float(math.ceil(wake.at_s / self._dt_s - 1e-9))
        self._due[node] = max(due, tick + 1)
        self._on_packet[node] = wake.on_packet
        for field, event in self.events.items():
            watching = getattr(wake, event.asked_by)
            if not (watching or self._watched[field]):
                continue
            self._watched[field] += watching - int(self._watching[field][node])
            self._watching[field][node] = watching
            self._at_rest[field][node] = False
            if watching and node in self._newest[field]:
                self._seen[field][node] = event.signature(self._newest[field][node])
        self._asleep[node] = None
        self._stale = True

    def note_packets(self, receivers: Sequence[int], tick: int) -> None:
        """Wake the sleepers among `receivers` that asked for packets."""
        for node in receivers:
            if self._on_packet[node]:
                self._due[node] = tick

    @property
    def watching(self) -> bool:
        """True if any sleeper wakes on a change of a sensor."""
        return any(self._watched.values())

    def watchers(self, field: str) -> Ints:
        """Return the sleepers that wake on a change of the sensor `field`."""
        return np.flatnonzero(self._watching[field]) if self._watched[field] else _NO_NODES

    def at_rest(self, field: str, nodes: Ints) -> Bools:
        """Return (k,) which of `nodes` had nothing to sense when their readings were compared last, since they sleep."""
        return self._at_rest[field][nodes]

    def note_readings(
        self, field: str, nodes: Ints, readings: Sequence[Any], tick: int, is_steady: bool = False
    ) -> None:
        """Wake those of `nodes` whose reading differs from the one they observed last.

        `is_steady` states that the readings stay the same while no body moves.
        """
        (_, signature, rest), seen = self.events[field], self._seen[field]
        signatures = [signature(each) for each in readings]
        for node, now in zip(nodes.tolist(), signatures, strict=True):
            if now != seen.get(node):
                self._due[node] = tick
        self._at_rest[field][nodes] = [each == rest for each in signatures] if is_steady else False

    def remember(self, field: str, nodes: Sequence[int], readings: Sequence[Any]) -> None:
        """Keep the readings that `nodes` observe now. While the same nodes are awake, they replace the ones before."""
        if field in self._unmerged and self._unmerged[field][0] != nodes:
            self._catch_up()
        self._unmerged[field] = nodes, readings

    def _catch_up(self) -> None:
        for field, (nodes, readings) in self._unmerged.items():
            self._newest[field].update(zip(nodes, readings, strict=True))
        self._unmerged.clear()

    def awake(self, tick: int) -> Ints:
        """Return the nodes to observe at `tick`, ascending; sleepers among them are awake from now on."""
        if self._asleep or self._stale:
            self._ids = (self._due <= tick).nonzero()[0]
            self._stale = False
            for node in self._ids.tolist():
                if node in self._asleep:
                    self._rouse(node)
                    self._due[node] = -1.0
        return self._ids

    def _rouse(self, node: int) -> None:
        self._asleep.pop(node, None)
        self._on_packet[node] = False
        for field, watching in self._watching.items():
            if self._watched[field] and watching[node]:
                watching[node] = False
                self._watched[field] -= 1

    @property
    def sleeping(self) -> bool:
        """True if any node sleeps."""
        return bool(self._asleep)


_NO_NODES: Final[Ints] = np.zeros(0, dtype=np.int64)
