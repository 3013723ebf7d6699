"""Continuous collision: the speed at which bodies may approach each other, so that no substep carries one into another.

The engine finds a contact only where bodies overlap already. At 1 m/s and a substep of 12 ms they may overlap by 12 mm
before it acts. With a limit of their approach they stop where they touch.
"""

from typing import Final, NamedTuple, Self

import numpy as np

from zwerm.world.geometry.segments import Segments
from zwerm.world.scene import Floats, Ints

# Passes that share a limit between two bodies. Later passes stop both bodies.
_SHARED_PASSES: Final = 30

# A speed that rounding can cause [m/s].
_NO_SPEED_M_S: Final = 1e-9


class Meeting(NamedTuple):
    """Bodies that may meet within a tick: rows `first` and `second` (k,), and rows `at_wall` with the walls `wall`."""

    first: Ints
    second: Ints
    at_wall: Ints
    wall: Ints


class _Contacts(NamedTuple):
    """Possible contacts: of row `first` with row `second`, -1 for a wall, in the direction `towards`, at a gap [m]."""

    first: Ints
    second: Ints
    towards: Floats
    gap_m: Floats

    def joined(self, other: Self) -> "_Contacts":
        return _Contacts(*(np.concatenate(both) for both in zip(self, other, strict=True)))


class ApproachLimit:
    """The limit of discs of `radius_m` between walls `segments` (m, 4), of which none exceeds `max_speed_m_s`.

    A substep lasts `substep_s`, a tick `dt_s`. Bodies that touch overlap by `overlap_m`, so that the engine sees them.
    """

    def __init__(
        self, radius_m: float, max_speed_m_s: float, segments: Floats, dt_s: float, substep_s: float, overlap_m: float
    ) -> None:
        from scipy.spatial import cKDTree  # slow to import, and few bodies have this limit

        self._tree = cKDTree
        self._radius_m = radius_m
        self._overlap_m = overlap_m
        self._substep_s = substep_s
        self._walls = Segments.of(segments)
        # The way of one body in a tick, and a quarter of a body for what the solver adds.
        self._way_m = max_speed_m_s * dt_s + 0.25 * radius_m

    def meeting(self, position: Floats) -> Meeting | None:
        """Return which bodies at `position` (n, 2) [m] may meet within a tick, None if none may."""
        pairs = self._tree(position).query_pairs(2.0 * (self._radius_m + self._way_m), output_type="ndarray")
        if not len(pairs):
            return None
        bodies = np.unique(pairs)
        x, y = position[bodies].T[:, :, None]
        nx, ny = self._walls.nearest(x, y, np.s_[:])
        row, wall = np.nonzero(np.hypot(nx - x, ny - y) < self._radius_m + self._way_m)
        return Meeting(pairs[:, 0], pairs[:, 1], bodies[row], wall)

    def slow(self, position: Floats, velocity: Floats, meeting: Meeting) -> bool:
        """Slow bodies down so that none of `meeting` meets within a substep; return whether any was slowed.

        `position` [m] and `velocity` [m/s] are (n, 2); `velocity` is changed. A body loses only of its own approach to
        the other, so no body is driven away.
        """
        contacts = self._contacts(position, meeting)
        first, second, towards, _ = contacts
        allowed = np.maximum(contacts.gap_m, 0.0) / self._substep_s
        moving = np.append(velocity, [[0.0, 0.0]], axis=0)  # row -1 is a wall
        passed = 0
        while True:
            approach = np.einsum("kd,kd->k", moving[first] - moving[second], towards)
            fast = np.flatnonzero(approach > allowed + _NO_SPEED_M_S)
            if not len(fast):
                break
            for contact in fast.tolist():
                i, j = int(first[contact]), int(second[contact])
                if passed >= _SHARED_PASSES:
                    moving[[i, j]] = 0.0
                    continue
                line = towards[contact]
                along_i, along_j = float(moving[i] @ line), float(moving[j] @ line)
                excess = along_i - along_j - float(allowed[contact])
                if excess > 0.0:
                    own_i, own_j = max(along_i, 0.0), max(-along_j, 0.0)
                    moving[i] -= line * (excess * own_i / (own_i + own_j))
                    moving[j] += line * (excess * own_j / (own_i + own_j))
            passed += 1
        velocity[:] = moving[:-1]
        return passed > 0

    def _contacts(self, position: Floats, meeting: Meeting) -> _Contacts:
        """Return the possible contacts. The way along `towards` bounds the distance at the end from below."""
        pairs = self._contact(meeting.first, meeting.second, position, position[meeting.second], 2.0 * self._radius_m)
        x, y = position[meeting.at_wall].T
        nearest = np.column_stack(self._walls.nearest(x, y, meeting.wall))
        return pairs.joined(self._contact(meeting.at_wall, np.full(len(x), -1), position, nearest, self._radius_m))

    def _contact(self, first: Ints, second: Ints, position: Floats, other: Floats, touching_m: float) -> _Contacts:
        offset = other - position[first]
        distance = np.hypot(offset[:, 0], offset[:, 1])
        towards = offset / np.maximum(distance, 1e-12)[:, None]
        return _Contacts(first, second, towards, distance - touching_m + self._overlap_m)
