"""A radio without robots, for tests that count packets."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from support import scenario

from zwerm.catalogue import RADIO_MODELS
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Packet, Transmission
from zwerm.world.arena.arena import Arena
from zwerm.world.radio.medium import Medium
from zwerm.world.radio.registry import find
from zwerm.world.scene import Scene

DT_S = 0.1

# A table of each radio model of the catalogue, by kind.
EXAMPLES: dict[str, dict[str, Any]] = {kind: {"kind": kind, **find(kind).example} for kind in RADIO_MODELS}


class Radio:
    """Nodes at fixed `positions` that send given packets. `received` maps a node to its list of (tick, packet)."""

    def __init__(
        self,
        positions: Sequence[tuple[float, float]],
        models: Sequence[dict[str, Any]] = (),
        seed: int = 1,
        walls: Sequence[Any] = (),
        **radio: Any,
    ) -> None:
        table = {"models": list(models), "check": True, **radio}
        robots = {"count": len(positions), "controller": "random-walk", "sensors": []}
        self.scenario: Scenario = scenario(
            arena={"size_m": [100.0, 100.0], "walls": list(walls)}, robots=robots, radio=table
        )
        self.arena = Arena.from_table(self.scenario.arena, self.scenario.folder)
        self.draws = Draws(seed)
        self.medium = Medium(self.scenario, self.arena, self.draws)
        self.position = np.array(positions, dtype=np.float64)
        self.tick = 0
        self.received: dict[int, list[tuple[int, Packet]]] = {node: [] for node in range(len(positions))}

    def scene(self) -> Scene:
        count = len(self.position)
        still, there = np.zeros(count, dtype=np.bool_), np.ones(count, dtype=np.bool_)
        heading = np.zeros(count)
        place = self.position.copy()
        return Scene(self.tick, self.tick * DT_S, place, heading, there, still, 0.05, self.arena, self.draws)

    def step(self, outboxes: Mapping[int, Sequence[Transmission]], listeners: Sequence[int] | None = None) -> None:
        """One tick: `listeners` (all nodes, if None) receive their packets, then the outboxes are sent."""
        self.medium.arrive(self.tick)
        nodes = list(range(len(self.position))) if listeners is None else list(listeners)
        for node, packets in zip(nodes, self.medium.deliver(nodes, self.tick), strict=True):
            self.received[node] += [(self.tick, packet) for packet in packets]
        self.medium.send(self.scene(), sorted(outboxes.items()))
        self.tick += 1

    def all_broadcast(self, ticks: int, payload: bytes = b"0123456789abcdef") -> dict[str, Any]:
        """Let all nodes broadcast at every tick, then step until no packet is in flight; return the summary."""
        everyone = {node: (Transmission("robots", payload),) for node in range(len(self.position))}
        for _ in range(ticks):
            self.step(everyone)
        for _ in range(100_000):
            if not self.medium.summary()["in_flight"]:
                break
            self.step({})
        return self.medium.summary()

    def one_link(self, ticks: int, payload: bytes = b"0123456789abcdef") -> dict[str, Any]:
        """Let robot 0 send one packet to robot 1 at every tick."""
        for _ in range(ticks):
            self.step({0: (Transmission("robots", payload, to=1),)})
        for _ in range(100_000):
            if not self.medium.summary()["in_flight"]:
                break
            self.step({})
        return self.medium.summary()


def ring(count: int, radius_m: float = 1.0) -> list[tuple[float, float]]:
    """Return places on a circle in the middle of the arena."""
    angle = 2.0 * np.pi * np.arange(count) / count
    return [(50.0 + radius_m * float(np.cos(a)), 50.0 + radius_m * float(np.sin(a))) for a in angle]
