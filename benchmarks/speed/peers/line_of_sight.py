"""The task of the peers: e-pucks that drive by one bit of line of sight, and the measurement of its cost.

Robots start in a square, 0.16 m² for each, with random headings. At each tick of 0.1 s a robot senses whether another
robot's disc is straight ahead, and sets one of two pairs of wheel speeds. This file needs NumPy only: the workers run in
environments of their own.
"""

import json
import math
import sys
import time
from collections.abc import Callable

import numpy as np

AREA_M2 = 0.16
DT_S = 0.1
RADIUS_M = 0.037
WHEEL_BASE_M = 0.051
SPEED_M_S = 0.128
# Left and right wheel without a robot in sight, and with one: Ozdemir et al. 2019, section III-D.
WHEELS = ((0.719558, 0.412543), (-0.998071, -0.911843))
WARM_TICKS = 5


def side_m(robots: int) -> float:
    """Return the side of the square [m]."""
    return math.sqrt(AREA_M2 * robots)


def starts(robots: int) -> np.ndarray:
    """Return start poses (n, 3): x, y [m] and heading [rad], on a grid without overlaps."""
    random = np.random.Generator(np.random.Philox(1))
    columns = math.ceil(math.sqrt(robots))
    cell_m = side_m(robots) / columns
    places = np.array([divmod(robot, columns) for robot in range(robots)], dtype=np.float64)
    return np.column_stack([(places + 0.5) * cell_m, random.uniform(-math.pi, math.pi, robots)])


def sees(x: np.ndarray, y: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """Return (n,) whether each robot has another one straight ahead: all pairs at once, without walls."""
    dx, dy = x - x[:, None], y - y[:, None]
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    across, ahead = cos * dy - sin * dx, cos * dx + sin * dy
    met = (np.abs(across) <= RADIUS_M) & (ahead > 0.0)
    np.fill_diagonal(met, False)
    return met.any(axis=1)


def velocity(seen: bool) -> tuple[float, float]:
    """Return forward speed [m/s] and turn [rad/s] of a robot that sees a robot or none."""
    left, right = WHEELS[seen]
    return 0.5 * (left + right) * SPEED_M_S, (right - left) * SPEED_M_S / WHEEL_BASE_M


def main(make: Callable[[int], Callable[[], object]], worlds: int = 1) -> None:
    """Print the robot-ticks per second of processor time, as JSON. `make`, of a number of robots, returns what runs one tick.

    Arguments of the program: the number of robots, and of the ticks that are measured.
    """
    robots, ticks = int(sys.argv[1]), int(sys.argv[2])
    tick = make(robots)
    for _ in range(WARM_TICKS):
        tick()
    began_s = time.process_time()
    for _ in range(ticks):
        tick()
    print(json.dumps({"rate": worlds * robots * ticks / (time.process_time() - began_s)}))
