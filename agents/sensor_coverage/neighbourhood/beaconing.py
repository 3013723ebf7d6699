"""Beaconing: a robot broadcasts its state and its route when they change, on request, and periodically."""

from collections.abc import Callable
from typing import ClassVar, Final

import msgspec

from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, PathVector, StateBeacon, StateRequest
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing

# Ticks after which a change is broadcast again, and the period of the heartbeat, while messages are lost.
REPEAT_TICKS: Final = (4, 10, 22)
LOSSY_HEARTBEAT_TICKS: Final = 24
# Ticks after a loss during which messages count as being lost.
LOSSY_TICKS: Final = 600
# A new robot does not know whether messages are lost. It assumes so for this many ticks.
NEW_TICKS: Final = 100
# Minimum ticks between broadcasts of the route alone: a route is often found in several steps.
ROUTE_TICKS: Final = 4
# Period of the heartbeat while no message is lost.
HEARTBEAT_TICKS: Final = 100


class Beaconing(Component):
    """One robot's broadcasts. `heartbeat` is the tick of the next broadcast without any change.

    `waiting` is true if the robot stands at the base, ready to go.
    """

    channel: ClassVar[str] = CHANNEL
    accepts: ClassVar[tuple[type, ...]] = (StateRequest,)

    def __init__(self, local_map: LocalMap, waiting: Callable[[], bool] = lambda: False) -> None:
        self.heartbeat = 0
        self._local_map = local_map
        self._waiting = waiting
        self._tick = 0
        self._state: StateBeacon | None = None
        self._state_basis: object = None
        self._number = 0
        self._due: list[int] = []
        self._sent = NO_PATH_VECTOR
        self._route_due: list[int] = []
        self._sent_at = -ROUTE_TICKS
        self._lossy_until: int | None = None

    def repeat(self, tick: int) -> None:
        """Broadcast the state in this tick: a neighbour asked for it, or may lack it."""
        self._due[:0] = [tick]

    def missed(self, tick: int) -> None:
        """Record that a message was lost."""
        self._lossy_until = tick + LOSSY_TICKS

    def receive(self, sender: int, message: StateRequest, tick: int) -> None:
        """Take in a request for states."""
        if not message.nodes or self._local_map.node in message.nodes:
            self.repeat(tick)

    def poll(self, tick: int) -> None:
        """Set the time of this tick."""
        self._tick = tick

    def outgoing(self) -> list[Outgoing]:
        """Return the broadcasts of this tick, by the state at its end."""
        if self._lossy_until is None:
            self._lossy_until = self._tick + NEW_TICKS
        return self._state_beacon() + self._route_alone()

    def next_wake(self) -> int:
        """Return the tick of the next broadcast if nothing else happens."""
        earliest = self.heartbeat
        for due in (self._due, self._route_due):
            if due and due[0] < earliest:
                earliest = due[0]
        return earliest

    def _state_beacon(self) -> list[Outgoing]:
        tick, local_map, waiting = self._tick, self._local_map, self._waiting()
        basis = local_map.version, local_map.plan_count, waiting
        if basis != self._state_basis:
            self._state_basis = basis
            state = local_map.state(waiting)
            if state != self._state:
                self._state = state
                self._number += 1
                self._due = self._times(tick)
        if self._state is None or not (tick >= self.heartbeat or (self._due and tick >= self._due[0])):
            return []
        self._due = [each for each in self._due if each > tick]
        self._route_due = [each for each in self._route_due if each > tick]
        period = LOSSY_HEARTBEAT_TICKS if self._lossy else HEARTBEAT_TICKS
        self.heartbeat = tick + period + local_map.node % 10
        beacon = msgspec.structs.replace(self._state, number=self._number, path_vector=self._path_vector())
        return [Outgoing(None, beacon)]

    def _route_alone(self) -> list[Outgoing]:
        """Return the path vector, if nothing but the route has changed."""
        tick, local_map = self._tick, self._local_map
        sent = self._sent
        if not self._route_due and (sent.slot != local_map.slot or sent.route != local_map.route):
            self._route_due = self._times(max(tick, self._sent_at + ROUTE_TICKS))
        if not self._route_due or tick < self._route_due[0]:
            return []
        self._route_due = [each for each in self._route_due if each > tick]
        return [Outgoing(None, self._path_vector())]

    def _times(self, first: int) -> list[int]:
        return [first, *(first + each for each in REPEAT_TICKS if self._lossy)]

    @property
    def _lossy(self) -> bool:
        return self._lossy_until is not None and self._tick < self._lossy_until

    def _path_vector(self) -> PathVector:
        """Return the path vector with the present route."""
        self._sent_at = self._tick
        local_map, sent = self._local_map, self._sent
        reach = local_map.reach
        new = local_map.slot, local_map.route, reach.hops, reach.count
        if (sent.slot, sent.route, sent.home, sent.base_count) != new:
            slot, route, hops, count = new
            self._sent = PathVector(sent.number + 1, slot, route, local_map.path_vectors.ended, hops, count)
        return self._sent
