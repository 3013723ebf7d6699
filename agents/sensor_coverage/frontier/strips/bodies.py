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


def arcs_of_robots(directions: Iterable[float], walls: Iterable[float]) -> Iterator[Arc]:
    """Yield the arcs that standing robots in touch close; their directions and those of walls in touch are in [rad]."""
    for each in directions:
        yield Arc(each - BODY_RAD, 2.0 * BODY_RAD)
        for wall in walls:
            if abs(math.remainder(wall - each, math.tau)) <= BETWEEN_RAD:
                yield arc_between(each, wall)


def is_behind(body_rad: float, point_rad: float) -> bool:
    """Return whether the body of a robot in touch, in the first direction [rad], hides a point in the second one."""
    return abs(math.remainder(body_rad - point_rad, math.tau)) <= BODY_RAD


def arcs_to_robot(there_rad: float, walls: Iterable[float], back_rad: float, followed: Iterable[Arc]) -> Iterator[Arc]:
    """Yield the arcs of a slot between a robot in touch and walls in touch at which that robot knows how the wall goes on.

    The slot sees the robot in the direction `there_rad`, and the walls in the directions `walls` [rad]. The robot sees this
    slot's robot in the direction `back_rad`. `followed` has its own arcs at followed walls: they contain the contact, wherever
    it is within the error of its direction. The space beyond the line to the contact is then the part of that robot.
    """
    known = united(followed)
    for wall in walls:
        off = math.remainder(wall - there_rad, math.tau)
        if abs(off) <= BETWEEN_RAD:
            continue  # nothing has to be known
        # From the other robot's centre, two radii away, to the contact, one radius away.
        first, last = (_seen_contact(abs(off) + error) for error in (CONTACT_RAD, -CONTACT_RAD))
        start = back_rad - last if off >= 0.0 else back_rad + first
        if contains(known, Arc(start, last - first)):
            yield arc_between(there_rad, wall)


def _seen_contact(wall_rad: float) -> float:
    """Return the angle [rad] at which a robot in touch sees a contact of this one, from the direction to this one's centre."""
    wall_rad = min(wall_rad, math.pi)
    return math.atan2(math.sin(wall_rad), 2.0 - math.cos(wall_rad))
