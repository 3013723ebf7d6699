"""Following the boundary by touch: the direction in which a disc goes on with its contacts on one hand.

The robot takes the tangent nearest to the wall that leads into no other contact. At a concave corner it turns away; at
a convex corner it rolls around the vertex. It presses a little against the contact, so that it does not lose it.
"""

import math
from collections.abc import Sequence
from typing import Final

Vector = tuple[float, float]

LEFT_HAND: Final = 1  # the wall is on the left
RIGHT_HAND: Final = -1

# The part of the speed that presses against the wall.
PRESS: Final = 0.2
# A direction leads into a contact if this much of it does.
INTO: Final = 0.05
# Largest turn of a tangent towards the wall [rad]; a larger one counts as a turn away.
TOWARDS_WALL_RAD: Final = math.radians(100.0)


class WallFollower:
    """Follows the touched boundary with the wall on its `hand`, first in the direction `tangent` (a unit vector)."""

    def __init__(self, hand: int, tangent: Vector) -> None:
        self.hand = hand
        self.tangent = tangent

    def direction(self, walls: Sequence[Vector], others: Sequence[Vector] = ()) -> Vector:
        """Return the unit vector to move along; `others` are bodies that count as walls but are not pressed against."""
        tx, ty = self.tangent
        hand = self.hand
        contacts = (*walls, *others)
        if not contacts:
            # The wall is lost: look for it on its hand, and a little ahead.
            vx, vy = 0.5 * tx - hand * ty, 0.5 * ty + hand * tx
            length = math.hypot(vx, vy)
            return vx / length, vy / length
        best, best_turn, push = None, math.inf, (0.0, 0.0)
        least, least_into = None, math.inf
        for index, (nx, ny) in enumerate(contacts):
            cx, cy = (ny, -nx) if hand == LEFT_HAND else (-ny, nx)
            into = max([cx * mx + cy * my for mx, my in contacts])
            if into < least_into:
                least, least_into = (cx, cy), into
            if into > INTO:
                continue
            # The turn away from the wall, from the last tangent to this one.
            turn = -hand * math.atan2(tx * cy - ty * cx, tx * cx + ty * cy)
            if turn < -TOWARDS_WALL_RAD:
                turn += 2.0 * math.pi
            if turn < best_turn:
                best, best_turn = (cx, cy), turn
                push = (nx, ny) if index < len(walls) else (0.0, 0.0)
        if best is None:
            best = least
            assert best is not None
        self.tangent = best
        vx, vy = best[0] + PRESS * push[0], best[1] + PRESS * push[1]
        length = math.hypot(vx, vy)
        return vx / length, vy / length
