"""Distances of robots in view at the end of a walk, by their bearings along the walk and odometry.

Walls determine where a walk ends, and not the range of sight. So a slot there is nearer to its neighbours than a hop.
"""

import math
from collections.abc import Sequence
from typing import Final

from zwerm.agents.sensor_coverage.messages.commands import Waypoint

# Rays to a robot that must differ by this [rad] to determine its distance.
RAYS_RAD_MIN: Final = 0.3


def distances_m(waypoints: Sequence[Waypoint]) -> dict[int, float]:
    """Return by robot the distance [m] from the last of some waypoints, for the robots in view there.

    Robots whose distance their bearings do not determine are left out.
    """
    found = {}
    for node in (each.node for each in waypoints[-1].sightings) if waypoints else ():
        rays = [
            (each.x_m, each.y_m, one.bearing_rad) for each in waypoints for one in each.sightings if one.node == node
        ]
        at = crossing(rays)
        if at is not None:
            found[node] = math.hypot(at[0] - waypoints[-1].x_m, at[1] - waypoints[-1].y_m)
    return found


def crossing(rays: Sequence[tuple[float, float, float]]) -> tuple[float, float] | None:
    """Return the point [m] nearest to rays (x [m], y [m], bearing [rad]), or None if they are nearly parallel."""
    sxx = sxy = syy = bx = by = 0.0
    for x, y, bearing in rays:
        nx, ny = -math.sin(bearing), math.cos(bearing)
        off = nx * x + ny * y
        sxx, sxy, syy = sxx + nx * nx, sxy + nx * ny, syy + ny * ny
        bx, by = bx + nx * off, by + ny * off
    det = sxx * syy - sxy * sxy
    if det < (len(rays) * math.sin(RAYS_RAD_MIN) / 4.0) ** 2:
        return None
    return (syy * bx - sxy * by) / det, (sxx * by - sxy * bx) / det
