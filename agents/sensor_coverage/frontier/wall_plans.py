"""Plans to follow walls: a robot drives into an open arc, to a wall, and along it.

The proof of coverage (`zwerm.agents.sensor_coverage.frontier.wall_proof`) finds the slots with open arcs, and these arcs.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Final

from zwerm.agents.sensor_coverage.frontier.decisions import CoverageProof
from zwerm.agents.sensor_coverage.frontier.plan import WALLS, Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.strips.sight_ends import united_round
from zwerm.agents.sensor_coverage.frontier.strips.way_begins import begin_width, end_width
from zwerm.agents.sensor_coverage.frontier.wall_proof import ANYONE, Arc, NearArc, contains
from zwerm.agents.sensor_coverage.messages.commands import NearArcs, NearWalls

# Fourth element of the keys of plans to join two parts of the swarm.
JOIN: Final = 2000
# Directions to try into an open arc, as fractions of its width, one after the other.
FRACTIONS: Final = (0.5, 0.5, 0.5, 0.5, 0.25, 0.75, 0.1, 0.9)
# In an arc up to the first width [rad] between a robot and a wall the first attempts go to the wall at its edge: in the middle
# the robot, or the opening beside it, is in the way. The edge is that robot if they differ by less than the second angle, and
# the robot drives to the wall the third angle beyond the edge.
AT_EDGE_RAD_MAX: Final = math.radians(60.0)
ROBOT_RAD: Final = math.radians(2.0)
BEYOND_EDGE_RAD: Final = math.radians(3.0)
AT_EDGE_MAX: Final = 4
# Attempts after which the walking robot stays in sight of the slot, and gets a slot where that would see it no more.
ANYWHERE_MAX: Final = 2
# Times that the attempts at an arc are made, while nothing else is left to do.
ROUNDS_MAX: Final = 3
# A probe goes this far [m] to a wall, and into open arcs up to this width [rad].
PROBE_M: Final = 0.14
PROBED_RAD_MAX: Final = math.radians(150.0)
# Without a coordinator only arcs up to this width [rad] are probed: a walk closes a wide arc as a whole, and what a probe
# leaves of it is hard to close.
SLIVER_RAD_MAX: Final = math.radians(20.0)
# Walks set out into narrower arcs only where no wide one has attempts left: a narrow one is the rest of what was seen before.
WIDE_RAD: Final = math.radians(60.0)
# Attempts to join two parts of the swarm by the same slot.
JOINS_MAX: Final = 4


class WallPlans:
    """Finds the places at which a robot must follow a wall.

    `unproven` are the slots that stay open after all attempts. `tried` has the directions [rad] of the attempts, by slot, and
    `probed` those of the probes.
    """

    def __init__(self, parameters: PlannerParameters, slots: Slots, proof: CoverageProof | None) -> None:
        self.unproven: tuple[int, ...] = ()
        self._parameters = parameters
        self._slots = slots
        self._proof = proof
        self.tried: dict[int, list[float]] = {}
        self._rounds = 1
        self._joined: dict[tuple[int, tuple[int, ...]], int] = {}
        self.probed: dict[int, list[float]] = {}

    def open_arcs(self, scan: ScanResult) -> dict[int, list[Arc]]:
        """Return the arcs in which each slot is open."""
        slots, proof = self._slots, self._proof
        if proof is None:
            raise RuntimeError("the arcs of all slots are known with a coordinator only")
        for slot in slots.take_replaced():
            self.probed.pop(slot, None)
        touched = {slot: slots.touching.get(slot, ()) for slot in scan.complex_.vertices}
        stays = slots.stays.numbers(slots.occupant)
        stale = proof.update(scan, slots.walks, touched, slots.near, slots.slots_in_touch(), stays, slots.touched_by)
        displaced = slots.take_displaced()
        for slot in (*stale, *displaced):
            self.tried.pop(slot, None)
        for slot in displaced:
            self.probed.pop(slot, None)
        return proof.open_arcs()

    def probes(self, scan: ScanResult) -> list[Plan]:
        """Return probes that go at once: of slots that do not see each other, so that others see the probes from their places.

        Stations do not move.
        """
        found, taken = list[Plan](), dict.fromkeys(scan.bases)
        for slot, open_arcs in self.open_arcs(scan).items():
            if slot not in taken and (probes := self.probes_at(slot, open_arcs)):
                found += probes
                taken |= dict.fromkeys((slot, *scan.complex_.neighbours[slot]))
        return found

    def probes_at(self, slot: int, arcs: Iterable[Arc]) -> list[Plan]:
        """Return a plan for each arc of a slot that was not probed yet: the robot there follows a wall close by, and returns.

        A robot in touch with another one has no room.
        """
        found, known = list[Plan](), self.probed.setdefault(slot, [])
        width_max = SLIVER_RAD_MAX if self._proof is None else PROBED_RAD_MAX
        for arc in () if self._slots.in_touch.get(slot) else arcs:
            if arc.width_rad <= width_max and not any(
                (each - arc.start_rad) % math.tau < arc.width_rad for each in known
            ):
                direction = math.remainder(arc.start_rad + arc.width_rad / 2.0, math.tau)
                known.append(direction)
                key = slot, slot, 0, WALLS + round(math.degrees(direction))
                half_rad = arc.width_rad / 2.0
                found.append(Plan(key, slot, direction, PROBE_M, 0.0, (slot,), walk=True, half_rad=half_rad))
        return found

    def plans(self, scan: ScanResult) -> Iterator[Plan]:
        """Yield a plan for each open arc that has attempts left, of the wide ones if there are any."""
        yield from self._joins(scan)
        unproven: dict[int, None] = {}
        wide, narrow = list[Plan](), list[Plan]()
        for slot, arcs in self.open_arcs(scan).items():
            if not scan.complex_.neighbours[slot]:
                continue
            neighbours = scan.complex_.neighbours[slot]
            found, exhausted = self.plans_at(slot, {each: scan.views[slot][each] for each in neighbours}, arcs)
            wide_arcs = [each for each in arcs if each.width_rad >= WIDE_RAD]
            for plan in found:
                (wide if contains(wide_arcs, Arc(plan.direction, 0.0)) else narrow).append(plan)
            if exhausted:
                unproven[slot] = None
        yield from wide or narrow
        self.unproven = tuple(unproven)

    def plans_at(self, slot: int, beside: Mapping[int, float], arcs: Iterable[Arc]) -> tuple[list[Plan], int]:
        """Return a plan for each arc of a slot that has attempts left, and the number of arcs that have none.

        `beside` has the directions [rad] of its neighbours. The first one names the frontier.
        """
        found, exhausted = list[Plan](), 0
        for arc in arcs:
            tried = sum((each - arc.start_rad) % math.tau < arc.width_rad for each in self.tried.get(slot, ()))
            if tried >= len(FRACTIONS):
                exhausted += 1
                continue
            edge = _edge_at_wall(arc, beside.values()) if tried < AT_EDGE_MAX else 0
            fraction = FRACTIONS[tried]
            direction = math.remainder(arc.start_rad + fraction * arc.width_rad, math.tau)
            aside_rad = edge * (arc.width_rad / 2.0 + BEYOND_EDGE_RAD)
            hand = (-1 if tried % 2 == 0 else 1) * (edge or 1)
            # A robot that comes from the slot, with the wall at its right hand, moves to the left.
            before = fraction * arc.width_rad if hand < 0 else (1.0 - fraction) * arc.width_rad
            found.append(
                Plan(
                    (slot, next(iter(beside)), 0, WALLS + round(math.degrees(direction))),
                    slot,
                    direction,
                    self._parameters.hop_m,
                    0.0,
                    (slot,),
                    walk=True,
                    hand=hand,
                    beside=tried >= ANYWHERE_MAX,
                    half_rad=max(0.0, before - hand * aside_rad),
                    aside_rad=aside_rad,
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

    def begin_again(self) -> bool:
        """Count the attempts at the arcs that stay open anew, a few times; return whether it was done.

        Noise and the places of other robots differ from walk to walk, and pushes have moved slots meanwhile.
        """
        if not self.unproven or self._rounds == ROUNDS_MAX:
            return False
        self._rounds += 1
        for slot in self.unproven:
            self.tried.pop(slot, None)
            self.probed.pop(slot, None)
        return True

    def forget(self) -> None:
        """Forget all attempts and probes."""
        self.tried.clear()
        self.probed.clear()

    def note_attempt(self, plan: Plan) -> None:
        """Record that a plan is tried."""
        if plan.meet:
            self._joined[plan.mover, plan.meet] = self._joined.get((plan.mover, plan.meet), 0) + 1
        else:
            self.tried.setdefault(plan.mover, []).append(plan.direction)

    def note_near(self, slot: int, walls: NearWalls, hand: int, robot: int = ANYONE) -> None:
        """Record walls close to a slot that were followed, with a hand at them. They count for the robot (`NearArc`)."""
        begins = [Arc(*each) for each in walls.begins]
        stay = self._slots.stays.number(slot, self._slots.occupant[slot])
        past_ends = [Arc(*each) for each in walls.past_ends]
        self._note_arcs(slot, (hand, robot, False, stay), walls.followed, begins, past_ends)
        self._note_arcs(slot, (hand, robot, True, stay), walls.past_ends)

    def _note_arcs(
        self,
        slot: int,
        kind: tuple[int, int, bool, int],
        arcs: NearArcs,
        begins: Sequence[Arc] = (),
        past_ends: Sequence[Arc] = (),
    ) -> None:
        """Record arcs (start, width) [rad] around a slot of one kind (`NearArc.kind`).

        Arcs of different walks stay apart: where they meet, a wall may end and another one begin far behind it.
        """
        known = self._slots.near.get(slot, [])
        same = [each.arc for each in known if each.kind == kind]
        fresh = [each for each in united_round(Arc(*each) for each in arcs) if not contains(same, each)]
        kept = [each for each in known if each.kind != kind or not contains(fresh, each.arc)]
        hand, robot, is_past_end, stay = kind
        added = (
            NearArc(
                each, hand, robot, is_past_end, begin_width(each, hand, begins), end_width(each, hand, past_ends), stay
            )
            for each in fresh
        )
        self._slots.note_near(slot, [*kept, *added])


def _edge_at_wall(arc: Arc, robots: Collection[float]) -> int:
    """Return which edge of an arc is at a wall where the other one is at a robot, +1 left, -1 right; 0 if there is none."""
    if arc.width_rad > AT_EDGE_RAD_MAX:
        return 0
    ends = arc.start_rad, arc.start_rad + arc.width_rad
    at_robot = [any(abs(math.remainder(each - end, math.tau)) < ROBOT_RAD for each in robots) for end in ends]
    return at_robot[0] - at_robot[1]
