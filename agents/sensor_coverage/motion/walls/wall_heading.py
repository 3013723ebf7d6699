"""The heading of a robot that keeps a hand on a wall, by the contacts in touch."""

import math
from collections.abc import Sequence
from typing import Final

from zwerm.agents.sensor_coverage.motion.odometry_frame import Touched

# The robot drives this much towards the wall, so that it stays in touch; half a switch's sector is 15 degrees.
PRESS_RAD: Final = math.radians(20.0)
# Turn towards the hand in each tick without a contact: a step of 0.05 m about a corner at a body's radius of 0.07 m.
TURN_RAD: Final = math.radians(40.0)


def hand_on_wall(wall_rad: float, contacts: Sequence[Touched], hand: int) -> tuple[float, float]:
    """Return the heading [rad] of the next step with a hand on the wall at `wall_rad`, and the wall's direction [rad] then.

    Without a contact the robot turns towards the hand, about a corner.
    """
    if contacts:
        heading = swept(wall_rad, contacts, hand)
        return heading, heading + hand * (math.pi / 2.0 - PRESS_RAD)
    turned = wall_rad + hand * TURN_RAD
    return turned - hand * (math.pi / 2.0 - PRESS_RAD), turned


def swept(wall_rad: float, contacts: Sequence[Touched], hand: int) -> float:
    """Return the heading [rad] that turns most towards the hand and that no contact blocks.

    The sweep begins at the direction of the wall and turns away from the hand. A contact blocks the directions within
    a right angle of it, less PRESS_RAD at a wall.
    """
    heading, turned = wall_rad, 0.0
    for _ in range(2 * len(contacts) + 1):
        jump = 0.0
        for each in contacts:
            limit = math.pi / 2.0 - (PRESS_RAD if each.node is None else 0.0)
            off = math.remainder(each.bearing_rad - heading, math.tau)
            if abs(off) < limit - 1e-6:
                jump = max(jump, limit - hand * off)
        if jump <= 0.0:
            break
        heading -= hand * jump
        turned += jump
        if turned > math.tau:
            break
    return heading
