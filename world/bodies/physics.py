"""Rigid bodies in the plane: pymunk discs that track the velocity of their drive, between walls.

In every substep a body receives the force that would give it the velocity of its drive. So contacts constrain the
velocity before it is integrated. A velocity set directly before each substep would be integrated first, and would
discard what the solver computed for friction and contacts. Contacts are inelastic; without friction they never turn a
body. Bodies have no other dynamics: no inertia between substeps, no slip.
"""

from typing import Final

import numpy as np
import pymunk
from pymunk import batch

from zwerm.scenario.tables import BodyTable
from zwerm.world.bodies import Velocities
from zwerm.world.bodies.approach import ApproachLimit, Meeting
from zwerm.world.bodies.engine_calls import reader, substeps
from zwerm.world.bodies.parking import FEW_BODIES, SEARCH_TICKS, Parking
from zwerm.world.geometry.segments import Segments
from zwerm.world.scene import Bools, Floats, Ints

# Iterations of the contact solver in each substep; a disc in the plane seldom touches more than four others.
_SWEEPS: Final = 4

# The fraction of an overlap that remains after one substep, and the overlap that the solver ignores [m].
_OVERLAP_LEFT_FRACTION: Final = 0.1
_OVERLAP_IGNORED_M: Final = 1e-5
# Ticks for which a body that was added may push others through walls: it may overlap them by a whole body, and the solver
# knows no way in between.
_SHOVING_TICKS: Final = 10

_FORCE: Final = batch.BodyFields.FORCE | batch.BodyFields.TORQUE
_VELOCITY: Final = batch.BodyFields.VELOCITY
_MOTION: Final = batch.BodyFields.POSITION | _VELOCITY
_VELOCITY_AND_FORCE: Final = _VELOCITY | batch.BodyFields.ANGULAR_VELOCITY | _FORCE
_POSE: Final = batch.BodyFields.POSITION | batch.BodyFields.ANGLE


class Physics:
    """The bodies of one swarm. `position` (n, 2) [m] and `heading` (n,) [rad] are the truth, indexed by robot id."""

    def __init__(self, body: BodyTable, segments: Floats, count: int, dt_s: float) -> None:
        self.position: Floats = np.zeros((count, 2))
        self.heading: Floats = np.zeros(count)
        self._table = body
        self._substep_s = dt_s / body.substeps
        self._moment = pymunk.moment_for_circle(body.mass_kg, 0.0, body.radius_m)
        self._space = _make_space(self._substep_s, body.friction, segments)
        self._bodies: dict[int, pymunk.Body] = {}
        self._present: Bools = np.zeros(count, dtype=np.bool_)
        self._walls = Segments.of(segments)
        self._shoving = 0  # ticks for which a body may be pushed through a wall
        # Contact, the way of both bodies until the next search, and half a body more for what the solver adds.
        self._parking = Parking(count, 3.0 * body.radius_m + 2.0 * body.max_speed_m_s * dt_s * SEARCH_TICKS)
        self._approach = (
            ApproachLimit(body.radius_m, body.max_speed_m_s, segments, dt_s, self._substep_s, 0.5 * _OVERLAP_IGNORED_M)
            if body.collide and body.continuous_collision
            else None
        )
        # The middle of each substep [s], and the factor from a change of velocity to the force that causes it.
        self._middle_s: Floats = np.arange(0.5, body.substeps)[:, None] * self._substep_s
        self._inertia: Floats = np.array([body.mass_kg, body.mass_kg, self._moment]) / self._substep_s
        # pymunk never frees the memory of a buffer, so these are all that this engine uses.
        self._order, self._poses, self._slowed = batch.Buffer(), batch.Buffer(), batch.Buffer()
        fields = [_VELOCITY_AND_FORCE, *[_FORCE] * (body.substeps - 1)]
        self._loads = [(each, batch.Buffer()) for each in fields]  # what each substep begins with
        self._read_poses = reader(self._space, _POSE, self._poses)
        # The newest drives, and those of the bodies in the engine. Which robots have a drive: None before it is needed.
        nothing = np.zeros(count)
        self._drives: Velocities = (nothing, None, nothing)
        self._engine_drives: Velocities = (nothing, None, nothing)
        self._driven_robots: Bools | None = np.zeros(count, dtype=np.bool_)
        self._resting = True
        self._arranged = False

    def add(self, robot: int, position: Floats, heading: float) -> None:
        """Put a robot's body into the arena."""
        body = pymunk.Body(self._table.mass_kg, self._moment)
        body.position = float(position[0]), float(position[1])
        body.angle = float(heading)
        disc = pymunk.Circle(body, self._table.radius_m)
        disc.friction = self._table.friction
        if not self._table.collide:
            disc.filter = pymunk.ShapeFilter(group=1)
        self._space.add(body, disc)
        self._bodies[robot] = body
        self._present[robot] = True
        self._parking.admit(robot)
        self.position[robot] = position
        self.heading[robot] = heading
        self._arranged = False
        self._shoving = _SHOVING_TICKS if self._table.collide else 0

    def fix(self, robot: int, position: Floats, heading: float) -> None:
        """Put a robot into the arena that never moves and never collides: a base station."""
        self.position[robot] = position
        self.heading[robot] = heading

    def remove(self, robot: int) -> None:
        """Remove a robot's body from the arena; `position` and `heading` keep its last pose."""
        body = self._bodies.pop(robot)
        self._present[robot] = False
        if not self._parking.parked[robot]:
            self._space.remove(body, *body.shapes)
        self._arranged = False

    def _arrange(self) -> None:
        """Rebuild the buffers: pymunk's batches follow its own order of bodies, and include the static one."""
        parked = self._parking.parked
        owner = {body.id: robot for robot, body in self._bodies.items() if not parked[robot]}
        self._order.clear()
        batch.get_space_bodies(self._space, batch.BodyFields.BODY_ID, self._order)
        ids = np.frombuffer(bytes(self._order.int_buf()), dtype=np.uintp).tolist()
        rows = [(row, owner[body]) for row, body in enumerate(ids) if body in owner]
        self._rows = _plain([row for row, _ in rows], len(rows))
        self._ids = _plain([robot for _, robot in rows], len(self.position))
        self._pushes: Floats = np.zeros((self._table.substeps, len(ids), 3))
        self._start: Floats = np.zeros((len(ids), 6))  # the velocity, and the force of the first substep
        for (_, buffer), values in zip(self._loads, [self._start, *self._pushes[1:]], strict=True):
            buffer.set_float_buf(values)
        self._integrate = substeps(self._space, self._substep_s, self._loads)
        self._resting = False
        self._arranged = True

    def _driven(self) -> Bools:
        """Return (n,) which robots have a drive at all."""
        if self._driven_robots is None:
            forward, left, turn = self._drives
            self._driven_robots = (forward != 0.0) | (turn != 0.0)
            if left is not None:
                self._driven_robots |= left != 0.0
        return self._driven_robots

    def _park(self) -> None:
        """Move bodies into the engine and out of it."""
        entering, leaving = self._parking.change(self.position, self._present, self._driven())
        for robot in entering.tolist():
            body = self._bodies[robot]
            self._space.add(body, *body.shapes)
        for robot in leaving.tolist():
            body = self._bodies[robot]
            self._space.remove(body, *body.shapes)
        if len(entering) or len(leaving):
            self._arranged = False

    def advance(self, forward_m_s: Floats, left_m_s: Floats | None, turn_rad_s: Floats) -> Bools:
        """Integrate one tick under the drives (n,), by robot id; return (n,) which robots moved.

        The same arrays as before mean the same drives: do not write to them.
        """
        moved: Bools = np.zeros(len(self.position), dtype=np.bool_)
        last_forward, last_left, last_turn = self._drives
        same = forward_m_s is last_forward and left_m_s is last_left and turn_rad_s is last_turn
        if not same:
            self._drives, self._driven_robots = (forward_m_s, left_m_s, turn_rad_s), None
            self._parking.urge()
        if self._resting and self._arranged and not self._driven().any():
            return moved
        may_park = len(self._bodies) > FEW_BODIES or self._parking.in_use
        if may_park:
            self._park()
        if not (same and self._arranged):
            if not self._arranged:
                self._arrange()
            ids = self._ids
            self._engine_drives = (
                forward_m_s[ids],
                None if left_m_s is None else left_m_s[ids],
                turn_rad_s[ids],
            )
        ids, rows = self._ids, self._rows
        forward, left, turn = self._engine_drives
        # The heading in the middle of each substep, so that an arc is integrated by its chords.
        here, heading = self.position[ids], self.heading[ids]
        angle = heading + self._middle_s * turn
        pushes = self._pushes
        if np.count_nonzero(angle):  # faster than any()
            cos, sin = np.cos(angle), np.sin(angle)
            vx, vy = forward * cos, forward * sin
            if left is not None:
                vx -= left * sin
                vy += left * cos
            pushes[:, rows, 0] = vx
            pushes[:, rows, 1] = vy
        else:
            pushes[:, rows, 0] = forward
            pushes[:, rows, 1] = 0.0 if left is None else left
        pushes[:, rows, 2] = turn
        self._start[:, :3] = pushes[0]
        # The force of substep s acts on the velocity that substep s + 1 integrates.
        pushes[:-1] = pushes[1:]
        pushes *= self._inertia
        self._start[:, 3:] = pushes[0]
        meeting = None if self._approach is None else self._approach.meeting(here)
        if meeting is None:
            self._integrate()
        else:
            self._integrate_approaching(meeting)
        self._read_poses()
        poses = np.frombuffer(self._poses.float_buf(), dtype=np.float64).reshape(-1, 3)[rows]
        place, angle = poses[:, :2], poses[:, 2]
        if self._shoving:
            self._shoving -= 1
            place = self._kept_inside(here, place)
        differs = here != place
        moved[ids] = differs[:, 0] | differs[:, 1] | (heading != angle)
        self.position[ids] = place
        self.heading[ids] = angle
        self._resting = not np.count_nonzero(moved)
        if may_park:
            self._parking.note_moved(moved)
        return moved

    def _kept_inside(self, here: Floats, there: Floats) -> Floats:
        """Return the places (k, 2) [m] to which bodies moved in this tick; one that crossed a wall is put back."""
        moved = np.flatnonzero((here != there).any(axis=1))
        crossing = moved[self._walls.crossed(here[moved], there[moved])]
        if not len(crossing):
            return there
        self._shoving = _SHOVING_TICKS
        kept = there.copy()
        kept[crossing] = here[crossing]
        for robot, (x, y) in zip(
            np.arange(len(self.position))[self._ids][crossing].tolist(), kept[crossing].tolist(), strict=True
        ):
            self._bodies[robot].position = x, y
        return kept

    def _integrate_approaching(self, meeting: Meeting) -> None:
        """Integrate one tick, in which the bodies of `meeting` approach each other no faster than they may."""
        for fields, buffer in self._loads:
            batch.set_space_bodies(self._space, fields, buffer)
            self._slow(meeting)
            self._space.step(self._substep_s)

    def _slow(self, meeting: Meeting) -> None:
        if self._approach is None:
            return
        self._poses.clear()
        batch.get_space_bodies(self._space, _MOTION, self._poses)
        motion = np.frombuffer(self._poses.float_buf(), dtype=np.float64).reshape(-1, 4)
        position, velocity = motion[self._rows, :2], motion[self._rows, 2:].copy()
        if self._approach.slow(position, velocity, meeting):
            slowed = motion[:, 2:].copy()
            slowed[self._rows] = velocity
            self._slowed.set_float_buf(slowed)
            batch.set_space_bodies(self._space, _VELOCITY, self._slowed)


def _make_space(substep_s: float, friction: float, segments: Floats) -> pymunk.Space:
    space = pymunk.Space()
    space.damping = 0.0  # velocities last one substep: the force of the drive sets them again
    space.iterations = _SWEEPS
    space.collision_slop = _OVERLAP_IGNORED_M
    space.collision_bias = _OVERLAP_LEFT_FRACTION ** (1.0 / substep_s)
    for x0, y0, x1, y1 in segments.tolist():
        wall = pymunk.Segment(space.static_body, (x0, y0), (x1, y1), 0.0)
        wall.friction = friction
        space.add(wall)
    return space


def _plain(rows: list[int], count: int) -> slice | Ints:
    """Return an index for these rows: a slice if they are all of `count` in order, which avoids a copy."""
    return slice(count) if rows == list(range(count)) else np.array(rows, dtype=np.int64)
