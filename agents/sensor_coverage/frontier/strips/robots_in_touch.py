"""The directions around a slot that the bodies of standing robots in touch fill, and those between such a body and a wall.

Behind its body a robot is responsible itself. A body is less than one diameter away from a wall that is in touch, too, if the
two are on one side. Otherwise they leave a mouth, and it depends on what the other robot knows of the wall.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Final

from zwerm.agents.sensor_coverage.frontier.wall_proof import CONTACT_RAD, Arc, arc_between, contains, united

# Half of the directions that the body of a robot in touch fills, less an error of its bearing of 5 degrees.
BODY_RAD: Final = math.radians(25.0)
# Greatest angle between a wall and a robot in touch, between which no opening fits.
BETWEEN_RAD: Final = math.radians(120.0)


def arcs_of_robot(
    there_rad: float, walls: Iterable[float], back_rad: float = 0.0, followed: Iterable[Arc] = ()
) -> Iterator[Arc]:
    """Yield the arcs in which a slot relies on a standing robot in touch: behind its body, and between it and walls in touch.

    The slot sees the robot in the direction `there_rad`, and the walls in the directions `walls` [rad]. The robot sees this
    slot's robot in the direction `back_rad`. `followed` has its own arcs at followed walls. A wall at the other side counts if
    they contain the contact, wherever it is within the error of its direction.
    """
    yield Arc(there_rad - BODY_RAD, 2.0 * BODY_RAD)
    known = united(followed)
    for wall in walls:
        off = math.remainder(wall - there_rad, math.tau)
        # From the other robot's centre, two radii away, to the contact, one radius away.
        first, last = (_seen_contact(abs(off) + error) for error in (CONTACT_RAD, -CONTACT_RAD))
        start = back_rad - last if off >= 0.0 else back_rad + first
        if abs(off) <= BETWEEN_RAD or contains(known, Arc(start, last - first)):
            yield arc_between(there_rad, wall)


def _seen_contact(wall_rad: float) -> float:
    """Return the angle [rad] at which a robot in touch sees a contact of this one, from the direction to this one's centre."""
    wall_rad = min(wall_rad, math.pi)
    return math.atan2(math.sin(wall_rad), 2.0 - math.cos(wall_rad))
