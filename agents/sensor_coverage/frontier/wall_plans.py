"""Plans to follow walls: a robot drives into an open arc, to a wall, and along it.

The proof of coverage (`zwerm.agents.sensor_coverage.frontier.wall_proof`) finds the slots with open arcs, and these arcs.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Final

from zwerm.agents.sensor_coverage.frontier.decisions import CoverageProof
from zwerm.agents.sensor_coverage.frontier.plan import WALLS, Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc

# Fourth element of the keys of plans to join two parts of the swarm.
JOIN: Final = 2000
# Directions to try into an open arc, as fractions of its width, one after the other.
FRACTIONS: Final = (0.5, 0.5, 0.5, 0.5, 0.25, 0.75, 0.1, 0.9)
# Attempts after which the walking robot stays in sight of the slot, and gets a slot where that would see it no more.
ANYWHERE_MAX: Final = 2
# Attempts to join two parts of the swarm by the same slot.
JOINS_MAX: Final = 4


class WallPlans:
    """Finds the places at which a robot must follow a wall.

    `unproven` are the slots that stay open after all attempts. `tried` has the directions [rad] of the attempts, by slot.
    """

    def __init__(self, parameters: PlannerParameters, slots: Slots, proof: CoverageProof | None) -> None:
        self.unproven: tuple[int, ...] = ()
        self._parameters = parameters
        self._slots = slots
        self._proof = proof
        self.tried: dict[int, list[float]] = {}
        self._joined: dict[tuple[int, tuple[int, ...]], int] = {}

    def open_arcs(self, scan: ScanResult) -> dict[int, list[Arc]]:
        """Return the arcs in which each slot is open."""
        slots, proof = self._slots, self._proof
        if proof is None:
            raise RuntimeError("the arcs of all slots are known with a coordinator only")
        touched = {slot: slots.touching.get(slot, ()) for slot in scan.complex_.vertices}
        stale = proof.update(scan, slots.walks, touched, slots.near, slots.slots_in_touch())
        for slot in (*stale, *slots.take_displaced()):
            self.tried.pop(slot, None)
        return proof.open_arcs()

    def plans(self, scan: ScanResult) -> Iterator[Plan]:
        """Yield a plan for each open arc that has attempts left."""
        yield from self._joins(scan)
        unproven: dict[int, None] = {}
        for slot, arcs in self.open_arcs(scan).items():
            if not scan.complex_.neighbours[slot]:
                continue
            found, exhausted = self.plans_at(slot, scan.complex_.neighbours[slot][0], arcs)
            yield from found
            if exhausted:
                unproven[slot] = None
        self.unproven = tuple(unproven)

    def plans_at(self, slot: int, beside: int, arcs: Iterable[Arc]) -> tuple[list[Plan], int]:
        """Return a plan for each arc of a slot that has attempts left, and the number of arcs that have none.

        `beside` is a neighbour of the slot, to name the frontier.
        """
        found, exhausted = list[Plan](), 0
        for arc in arcs:
            tried = sum((each - arc.start_rad) % math.tau < arc.width_rad for each in self.tried.get(slot, ()))
            if tried >= len(FRACTIONS):
                exhausted += 1
                continue
            direction = math.remainder(arc.start_rad + FRACTIONS[tried] * arc.width_rad, math.tau)
            found.append(
                Plan(
                    (slot, beside, 0, WALLS + round(math.degrees(direction))),
                    slot,
                    direction,
                    self._parameters.hop_m,
                    0.0,
                    (slot,),
                    walk=True,
                    hand=-1 if tried % 2 == 0 else 1,
                    beside=tried >= ANYWHERE_MAX,
                )
            )
        return found, exhausted

    def _joins(self, scan: ScanResult) -> Iterator[Plan]:
        """Yield plans to stand where a walk saw robots of two parts of the swarm that do not see each other."""
        pieces = scan.complex_.components()
        if len(pieces) < 2:
            return
        piece = {slot: number for number, each in enumerate(pieces) for slot in each}
        found: dict[tuple[int, int], float] = {}
        for walk in self._slots.walks:
            for point in walk.points:
                seen = [slot for slot in point.seen if slot in piece]
                for slot in seen:
                    for other in seen:
                        if piece[slot] != piece[other]:
                            found.setdefault((slot, piece[other]), point.seen[slot])
        for (slot, other), direction in sorted(found.items()):
            tried = self._joined.get((slot, pieces[other]), 0)
            if tried < JOINS_MAX and scan.complex_.neighbours[slot]:
                yield Plan(
                    (slot, scan.complex_.neighbours[slot][0], 0, JOIN + other),
                    slot,
                    math.remainder(direction, math.tau),
                    self._parameters.hop_m,
                    0.0,
                    (slot,),
                    walk=True,
                    hand=-1 if tried % 2 == 0 else 1,
                    meet=pieces[other],
                )

    def note_attempt(self, plan: Plan) -> None:
        """Record that a plan is tried."""
        if plan.meet:
            self._joined[plan.mover, plan.meet] = self._joined.get((plan.mover, plan.meet), 0) + 1
        else:
            self.tried.setdefault(plan.mover, []).append(plan.direction)

    def note_near(self, slot: int, arcs: Iterable[tuple[float, float]]) -> None:
        """Record arcs (start, width) [rad] around a slot in which a wall close to it was followed."""
        self._slots.near[slot] = [*self._slots.near.get(slot, ()), *(Arc(*each) for each in arcs)]
