"""Carrying out what faults demand of nodes' programs, for every driver alike.

When an order has been carried out, the node it is about is dead and buried, or has joined: whatever a dead program had still
said is refused as stale, and its end has been reported, so that nothing of it can be mistaken for its successor's.
"""

import time
from collections.abc import Callable, Sequence
from typing import Final

from zwerm.errors import LinkError
from zwerm.link import Arrival, Programs, WorldLink
from zwerm.world.lives import Order
from zwerm.world.world import World

BURIAL_DEADLINE_S: Final = 10.0


class Undertaker:
    """Carries out orders of `world` on `programs`, whose nodes are heard over `link`."""

    def __init__(
        self, world: World, link: WorldLink, programs: Programs | None, others: Callable[[Arrival], object]
    ) -> None:
        """`others` takes what other nodes say meanwhile."""
        self._world = world
        self._link = link
        self._programs = programs
        self._others = others

    def carry_out(self, orders: Sequence[Order]) -> None:
        """Do as told. Raises LinkError where a program does not die, or does not join."""
        for deed, node in orders:
            if self._programs is None:
                raise LinkError(f"node {node}: a fault would {deed} its program, which runs elsewhere")
            if deed == "kill":
                self._programs.kill(node)
                self._bury(node)
            elif deed == "start":
                self._programs.start(node)
                self._forget_the_former(node)
            elif deed == "pause":
                self._programs.pause(node)
            else:
                self._programs.resume(node)

    def _forget_the_former(self, node: int) -> None:
        """Take in what its former incarnation left: the new one has been sent nothing, and cannot have spoken."""
        while (arrival := self._link.receive(0.0)) is not None:
            if arrival.node != node:
                self._others(arrival)
            elif arrival.payload is not None:
                self._world.refused["stale-incarnation"] += 1

    def _bury(self, node: int) -> None:
        deadline = time.monotonic() + BURIAL_DEADLINE_S
        while (arrival := self._link.receive(max(0.0, deadline - time.monotonic()))) is not None:
            if arrival.node != node:
                self._others(arrival)
            elif arrival.payload is None:
                return
            else:
                self._world.refused["stale-incarnation"] += 1
        raise LinkError(f"node {node} was killed, and its end was not reported within {BURIAL_DEADLINE_S:g} s")
