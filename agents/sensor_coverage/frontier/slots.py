"""The coordinator's memory: slots, their occupants, and the directions in which robots see each other.

A slot outlives its robots: a push moves robots, not slots. Directions are in the frame of a base station. A robot's
bearings are turned into that frame by its heading. Headings come from reciprocal bearings alone, because the bearing
from a to b and the bearing from b to a are opposite. There are no positions and no distances.

The rotation between the frames of two stations is unknown until their robots see each other. So each heading is in the
frame of one robot, at first the robot's own. Two frames that meet become one.
"""

import cmath
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from operator import itemgetter
from typing import Final

from zwerm.agents.sensor_coverage.frontier.directions import (
    BESIDE_M,
    DISPLACED_M_MIN,
    Reference,
    add_wall,
    faced,
    is_beside,
    is_displaced,
    refined_heading,
    refined_reference,
)
from zwerm.agents.sensor_coverage.frontier.stays import Pushed, Stays
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    ANYONE,
    Arc,
    NearArc,
    Origin,
    Walk,
    WalkPoint,
    leaves_wall,
    tail,
    turned_vector,
)
from zwerm.agents.sensor_coverage.messages.commands import Sighting, Waypoint

NOBODY: Final = -2
# Length [m] of a leg of a walk that the next leg repeats, so that the wall between them is one stretch.
JOINED_M: Final = 1.0


class Slots:
    """Slots by number, and what is remembered of each. The first slots are those of the base stations.

    `occupant` has the robot at each slot. `heading` [rad] and `frame` are each robot's heading and the robot in whose
    frame it is. `view` has the bearings that each robot sees in its own frame. `walls` and `blocked` have, by slot, the
    directions of walls, and of drives that a wall stopped. `touching` has the directions of the walls that the present occupant
    touches where it stands: another occupant may stand beside an opening. `touched_by` has them for all `stays` of robots that
    the slot ever had, by slot and number. `near` has the arcs in which a wall close to a slot was followed. `walks` are the
    walls that robots followed. `length_m` has the distances [m] between slots that are not a hop apart.
    """

    def __init__(self) -> None:
        self.occupant: dict[int, int] = {}
        self.heading: dict[int, float] = {}
        self.view: dict[int, dict[int, float]] = {}
        self.walls: dict[int, list[float]] = {}
        self.blocked: dict[int, list[float]] = {}
        self.touching: dict[int, list[float]] = {}
        self.stays = Stays(DISPLACED_M_MIN)
        self.touched_by: dict[tuple[int, int], list[float]] = {}
        self.in_touch: dict[int, tuple[int, ...]] = {}  # the robots that the occupant of a slot touches now
        self.near: dict[int, list[NearArc]] = {}
        self._near_robot: dict[int, int] = {}  # whose way that was, by slot
        self.walks: list[Walk] = []
        self.length_m: dict[tuple[int, int], float] = {}
        # Driven from slot to slot, by the first robot or the first displaced one.
        self._ways: dict[tuple[int, int], tuple[float, float]] = {}
        self.frame: dict[int, int] = {}
        self._heading_readings: dict[int, int] = {}
        self._reference: dict[int, dict[int, Reference]] = {}  # by the slot that sees, then by the slot that it sees
        self._readers: dict[
            tuple[int, int], tuple[int | None, int | None]
        ] = {}  # the robots at both, at the last reading
        self._displaced: dict[int, None] = {}
        self._next = 0

    # --- slots and occupants ----------------------------------------------------------------------------------------

    def add(self, robot: int) -> int:
        """Create a slot for a robot, and return its number. A robot of unknown heading gets a frame of its own."""
        slot = self._next
        self._next += 1
        self.occupant[slot] = robot
        if robot not in self.heading:
            self.orient(robot, robot, 0.0)
        return slot

    def orient(self, robot: int, frame: int, heading: float) -> None:
        """Set a robot's heading [rad] in a frame for the first time."""
        self.heading[robot], self.frame[robot] = heading, frame
        self._heading_readings[robot] = 0

    def slot_of(self) -> dict[int, int]:
        """Return the slot of every robot."""
        return {robot: slot for slot, robot in self.occupant.items()}

    def drop(self, slot: int) -> None:
        """Forget a slot that no robot occupies."""
        robot = self.occupant.pop(slot, None)
        if robot is not None:
            self.view.pop(robot, None)
        self.walls.pop(slot, None)
        self.touching.pop(slot, None)
        self.in_touch.pop(slot, None)
        self.near.pop(slot, None)

    def take(self, robot: int, sightings: Iterable[Sighting]) -> None:
        """Store the bearings that a robot reports, in its own frame."""
        self.view[robot] = {each.node: each.bearing_rad for each in sightings}

    def touch(self, slot: int, directions: Iterable[float], robots: Iterable[int] = ()) -> bool:
        """Store the directions [rad] of walls and the robots that the occupant touches now; return whether they are new."""
        before = self.touching.get(slot, []), self.in_touch.get(slot, ())
        now, robots = list(directions), tuple(robots)
        self.touching[slot], self.in_touch[slot] = now, robots
        if slot in self.occupant:
            self.touched_by[slot, self.stays.number(slot, self.occupant[slot])] = now
        walls = self.walls.setdefault(slot, [])
        added = [each for each in now if add_wall(walls, each)]
        return bool(added) or before != (now, robots)

    def slots_in_touch(self) -> dict[int, tuple[int, ...]]:
        """Return by slot the slots of the robots that its occupant touches now, if these touch a robot in its direction."""
        slot_of, here = self.slot_of(), self.occupant
        facing = {each: faced(self.view.get(each, {}), self.in_touch.get(slot, ())) for each, slot in slot_of.items()}
        return {
            slot: tuple(slot_of[each] for each in robots if here.get(slot) in facing.get(each, ()))
            for slot, robots in self.in_touch.items()
        }

    def views(self) -> dict[int, dict[int, float]]:
        """Return the directions [rad] of the slots that each slot sees, in its frame."""
        slot_of = self.slot_of()
        return {
            slot: {
                slot_of[node]: bearing + self.heading[robot]
                for node, bearing in sorted(self.view.get(robot, {}).items())
                if node in slot_of
            }
            for slot, robot in sorted(self.occupant.items())
        }

    # --- headings and frames ----------------------------------------------------------------------------------------

    def learn_headings(self, fresh: Iterable[int]) -> None:
        """Refine the headings of the robots that have new readings, by their reciprocal bearings."""
        fresh = tuple(fresh)
        while any(self._merge_frames(robot) for robot in fresh):
            pass
        for robot in fresh:
            if robot == self.frame[robot]:
                continue
            pairs = ((self.heading[node] + back, bearing) for node, (bearing, back) in self._mutual(robot).items())
            readings = self._heading_readings.get(robot, 0)
            refined = refined_heading(self.heading[robot], readings, pairs)
            if refined is not None:
                self.heading[robot] = refined
                self._heading_readings[robot] = readings + 1

    def _merge_frames(self, robot: int) -> bool:
        """Merge a robot's frame with that of a robot it sees, if they differ; return whether that happened."""
        mine, others = self.frame[robot], self.frame
        met = min((others[node] for node in self._mutual(robot) if others[node] != mine), default=None)
        if met is None:
            return False
        off = 0j
        for one in [each for each, frame in self.frame.items() if frame == mine]:
            for node, bearing, back in ((n, *each) for n, each in self._mutual(one).items() if others[n] == met):
                off += cmath.exp(1j * (self.heading[node] + back + math.pi - self.heading[one] - bearing))
        old, new, by = (mine, met, cmath.phase(off)) if met < mine else (met, mine, -cmath.phase(off))
        self._turn(old, new, by)
        return True

    def _mutual(self, robot: int) -> dict[int, tuple[float, float]]:
        """Return (bearing there, bearing back) [rad] of the robots that this robot sees and that see it."""
        views = self.view
        return {
            node: (bearing, views[node][robot])
            for node, bearing in sorted(views.get(robot, {}).items())
            if node in self.frame and robot in views.get(node, ())
        }

    def _turn(self, old: int, new: int, by: float) -> None:
        """Turn all directions that are known in the frame `old` by `by` [rad] into the frame `new`."""
        turned = [slot for slot, robot in self.occupant.items() if self.frame[robot] == old]
        for robot, frame in self.frame.items():
            if frame == old:
                self.heading[robot] += by
                self.frame[robot] = new
        for slot in turned:
            for known in (self.walls, self.blocked, self.touching):
                if slot in known:
                    known[slot] = [each + by for each in known[slot]]
            self.near[slot] = [
                each._replace(arc=Arc(each.arc.start_rad + by, each.arc.width_rad)) for each in self.near.get(slot, ())
            ]
        for (slot, stay), contacts in self.touched_by.items():
            if slot in turned:
                self.touched_by[slot, stay] = [each + by for each in contacts]
        for (start, end), way in self._ways.items():
            if start in turned:
                self._ways[start, end] = turned_vector(way, by)
        self.walks = [each.turned(new, by) if each.frame == old else each for each in self.walks]
        spin = cmath.exp(1j * by)
        for slot in turned:
            seen = self._reference.get(slot, {})
            seen |= {other: (mean * spin, count) for other, (mean, count) in seen.items()}

    # --- walls that were followed -----------------------------------------------------------------------------------

    def take_walk(
        self,
        robot: int,
        hand: int,
        waypoints: Iterable[Waypoint],
        radius_m: float = 0.0,
        after: int | None = None,
        stays: bool = False,
        origin: Origin | None = None,
        moving: Collection[int] = (),
    ) -> int:
        """Store a walk of a robot along a wall, in sight of robots that stand at their slots, and return its number.

        It continues the walk with the number `after`. The robot stays at its end if `stays`. It began at the slot `origin`,
        which has its place by odometry. The robots `moving` were not at their slots all the time.
        """
        heading, frame, slot_of = self.heading[robot], self.frame[robot], self.slot_of()
        away = {robot, *moving}
        standing = {node: slot for node, slot in slot_of.items() if node not in away and self.frame[node] == frame}
        waypoints = tuple(waypoints)
        points = tuple(
            WalkPoint(
                {
                    standing[node]: bearing + heading + math.pi
                    for node, bearing in ((one.node, one.bearing_rad) for one in each.sightings)
                    if node in standing
                }
                | (
                    {}
                    if origin is None or each.start_rad is None
                    else {origin.slot: each.start_rad + heading + math.pi}
                ),
                tuple(bearing + heading for bearing in each.touched),
                tuple(standing[node] for node in each.robots if node in standing),
                any(node not in standing for node in each.robots),
                leaves_wall(hand, before.touched, each.touched, each.x_m - before.x_m, each.y_m - before.y_m),
                (),
                turned_vector((each.x_m, each.y_m), heading),
            )
            for before, each in pairwise(waypoints[:1] + waypoints)
        )
        if origin is not None:
            stay = self.stays.number(origin.slot, self.occupant[origin.slot])
            origin = Origin(origin.slot, turned_vector(origin.at, heading), stay)
        touched = self.stays.numbers({slot: self.occupant[slot] for each in points for slot in each.robots})
        if after is not None:
            points = tail(self.walks[after].points, JOINED_M) + points
            touched |= self.walks[after].stays
        end = slot_of.get(robot) if stays else None
        self.walks.append(Walk(frame, hand, points, radius_m, end, origin, touched))
        return len(self.walks) - 1

    def note_near(self, slot: int, arcs: Sequence[NearArc]) -> None:
        """Record all arcs of walls close to a slot, along which the robot there drove."""
        self.near[slot] = list(arcs)
        self._near_robot[slot] = self.occupant[slot]

    def note_push(self, slot: int, way: tuple[float, float]) -> None:
        """Note the way (x, y) [m] by which others have pushed the robot at a slot, in its own frame.

        In a passage they push it on again and again, along its lines of sight to the others. What it saw before closes nothing
        where it stands now: at first that is its own way along walls close to it.
        """
        pushed = self.stays.push(slot, self.occupant[slot], way)
        if pushed is Pushed.FAR:
            self._displaced[slot] = None
            self._forget_walls({slot: None})
        elif pushed is Pushed.NEAR and slot in self._near_robot:
            self._near_robot[slot] = NOBODY

    def take_replaced(self) -> tuple[int, ...]:
        """Forget the arcs that count for the former robots of slots at which others stand now, and return these slots.

        A robot may stand 0.05 m from where the former one did, and sees a wall 0.1 m away in other directions. If it stands
        farther away, what counts for any robot is forgotten, too.
        """
        replaced = tuple(slot for slot, robot in self._near_robot.items() if self.occupant.get(slot) != robot)
        for slot in replaced:
            self.near[slot] = [each for each in self.near.get(slot, ()) if each.robot == ANYONE]
            del self._near_robot[slot]
        for slot, robot in self.occupant.items():
            near, now = self.near.get(slot, ()), self.stays.number(slot, robot)
            noted = dict.fromkeys(each.stay for each in near if each.stay != now)
            if far := [
                each for each in noted if self.stays.apart_m(each, now, partial(self._distance_m, slot)) >= BESIDE_M
            ]:
                self.near[slot] = [each for each in near if each.robot != ANYONE or each.stay not in far]
        return replaced

    # --- directions between slots -----------------------------------------------------------------------------------

    def direction(self, a: int, b: int) -> float | None:
        """Return the reference direction [rad] from slot a to slot b, or None if there is none."""
        known = self._reference.get(a, {}).get(b)
        return None if known is None else cmath.phase(known[0])

    def remember(self, a: int, b: int, direction: float) -> None:
        """Set the reference direction [rad] from slot a to slot b, as another robot remembers it."""
        mean = cmath.rect(1.0, direction)
        self._refer(a, b, (mean, 1))

    def learn_references(self, views: Mapping[int, Mapping[int, float]]) -> None:
        """Refine the reference directions of all slots that see each other.

        If one is off, the new occupants of its slots stand elsewhere. What former ones saw of walls closes nothing there. A
        robot beside its slot sees walls close by in other directions: then they are forgotten, and those farther off are not.
        """
        displaced: dict[int, None] = {}
        for a, seen in views.items():
            for b, there in seen.items():
                back = views.get(b, {}).get(a)
                if back is None or b < a:
                    continue
                known = self._reference.get(a, {}).get(b)
                before, now = self._readers.get((a, b)), (self.occupant.get(a), self.occupant.get(b))
                if before is not None:
                    new = [slot for slot, was, is_ in zip((a, b), before, now, strict=True) if was != is_]
                    if is_displaced(known, there, back, self.length_m.get((a, b), math.inf)):
                        displaced |= dict.fromkeys(new or (a, b))
                    elif is_beside(known, there, back, self._distance_m(a, b)):
                        for slot in new:
                            self.near.pop(slot, None)
                self._readers[a, b] = now
                self.stays.see(a, b, self.occupant, there)
                self.stays.see(b, a, self.occupant, back)
                self._refer(a, b, refined_reference(known, there, back))
        if displaced:
            self._displaced |= displaced
            self._forget_walls(displaced)

    def _distance_m(self, a: int, b: int) -> float:
        """Return the distance [m] of two slots as it was measured, or driven (`note_way`), or infinity."""
        known = self.length_m.get((a, b))
        way = self._ways.get((a, b)) or self._ways.get((b, a))
        return known or (math.inf if way is None else math.hypot(*way))

    def note_way(
        self, start: int, end: int, way: tuple[float, float], by_odometry: bool, at_landmarks: bool = False
    ) -> None:
        """Note the way (x, y) [m] that a robot drove from slot to slot, in the frame of the directions.

        If it differs from what a former robot drove, the robot stands elsewhere: what former robots saw of walls closes nothing
        there. So it may if it found its place by odometry, where nobody drove before. Attempts at its arcs are not counted
        anew: where robots die one after the other, they had no end. Bearings of robots that stood still all the time
        (`at_landmarks`) show the place, however the robot drove there.
        """
        known, length_m = self._ways.get((start, end)), self.length_m.get((start, end))
        if known is not None:
            is_off = math.dist(known, way) > DISPLACED_M_MIN
        else:
            is_off = by_odometry if length_m is None else abs(length_m - math.hypot(*way)) > DISPLACED_M_MIN
        if is_off and not at_landmarks:
            seen = any(end in point.seen for walk in self.walks for point in walk.points)
            if seen or self.near.get(end):
                self._forget_walls({end: None})
        if is_off or known is None:
            self._ways[start, end] = way

    def _forget_walls(self, slots: Mapping[int, None]) -> None:
        """Forget what was seen from these slots of robots that followed walls."""
        for slot in slots:
            self.near.pop(slot, None)
        if any(slot in point.seen for walk in self.walks for point in walk.points for slot in slots):
            self.walks = [each.unseen_by(slots) for each in self.walks]

    def take_displaced(self) -> tuple[int, ...]:
        """Return, once, the slots of which it was forgotten what was seen from there of robots that followed walls."""
        found = tuple(self._displaced)
        self._displaced = {}
        return found

    def known_from(self, slot: int) -> Iterator[tuple[int, float]]:
        """Yield (slot, direction [rad]) of every occupied slot that was ever seen from this one, ascending."""
        for other, (mean, _) in sorted(self._reference.get(slot, {}).items(), key=itemgetter(0)):
            if other in self.occupant:
                yield other, cmath.phase(mean)

    def _refer(self, a: int, b: int, reference: Reference) -> None:
        """Set the reference direction from slot a to slot b, and the opposite one."""
        mean, count = reference
        self._reference.setdefault(a, {})[b] = reference
        self._reference.setdefault(b, {})[a] = -mean, count
