"""Plans to follow walls: a robot drives into an open arc, to a wall, and along it.

The proof of coverage (`zwerm.agents.sensor_coverage.frontier.wall_proof`) tells which arcs around which slots are open.
"""

import math
from collections.abc import Iterator
from typing import Final

from zwerm.agents.sensor_coverage.frontier.directions import add_wall
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, open_arcs

# Third and fourth element of the keys of these plans.
WALLS: Final = 300
# Directions to try into an open arc, as fractions of its width, one after the other.
FRACTIONS: Final = (0.5, 0.25, 0.75, 0.1, 0.9, 0.5)


class WallPlans:
    """Where walls are to be followed. `unproven` are the slots that stay open after all attempts."""

    def __init__(self, parameters: PlannerParameters, slots: Slots) -> None:
        self.unproven: tuple[int, ...] = ()
        self._parameters = parameters
        self._slots = slots
        self._tried: dict[int, list[float]] = {}

    def open_arcs(self, scan: ScanResult) -> dict[int, list[Arc]]:
        """Return the arcs in which each slot is open."""
        slots = self._slots
        touched = {slot: [*slots.walls.get(slot, ()), *slots.felt.get(slot, ())] for slot in scan.complex_.vertices}
        return open_arcs(scan.views, scan.complex_, slots.walks, touched)

    def plans(self, scan: ScanResult) -> Iterator[Plan]:
        """Yield a plan for each open arc that has attempts left."""
        unproven: dict[int, None] = {}
        for slot, arcs in self.open_arcs(scan).items():
            if not scan.complex_.neighbours[slot]:
                continue
            for arc in arcs:
                tried = sum((each - arc.start_rad) % math.tau < arc.width_rad for each in self._tried.get(slot, ()))
                if tried >= len(FRACTIONS):
                    unproven[slot] = None
                    continue
                direction = math.remainder(arc.start_rad + FRACTIONS[tried] * arc.width_rad, math.tau)
                number = round(math.degrees(direction))
                yield Plan(
                    (slot, scan.complex_.neighbours[slot][0], 0, WALLS + number),
                    slot,
                    direction,
                    self._parameters.hop_m,
                    0.0,
                    (slot,),
                    walk=True,
                    beside=tried > 0,
                )
        self.unproven = tuple(unproven)

    def note_attempt(self, plan: Plan) -> None:
        """Record that a plan is tried."""
        self._tried.setdefault(plan.mover, []).append(plan.direction)

    def note_wall(self, slot: int, direction: float) -> None:
        """Record a wall closer than a body [rad] beside a slot."""
        add_wall(self._slots.felt.setdefault(slot, []), direction)
