"""Small drawn buildings whose rooms are joined by openings that a body just fits through, for sensor coverage.

Two or three rooms, 2.5 to 5 m² together. Each joint is one of these, `OPENINGS_M` wide:

door       an opening in a wall of drawn thickness
corner     the same in the corner of the first room
bend       a passage with one right-angled bend
chicane    a passage with two right-angled bends

Some rooms have a niche of the same widths. The base stands at a drawn place of the first room, with a drawn heading.
"""

from typing import Final, NamedTuple

import numpy as np
import shapely
import shapely.affinity
from shapely.geometry import Polygon, box

from benchmarks.common.chosen_crash import ChosenCrash
from zwerm.world.faults.programs.crash import CrashTable
from zwerm.world.scene import Ints, Scene

OPENINGS_M: Final = (0.17, 0.45)
# A third of the openings is narrower than this [m], twice the width of a body.
NARROW_M: Final = 0.28
AREA_M2: Final = (2.5, 5.0)
JOINTS: Final = ("door", "corner", "bend", "chicane")
# Least distance [m] of the base from a wall.
BASE_M: Final = 0.12

Bounds = tuple[float, float, float, float]


class SmallBuilding(NamedTuple):
    """A drawn building: its free space, the base's pose (x, y [m], heading [rad]), and its joints.

    `narrowest_m` is the least width of a joint or niche. `opening` (x_min, y_min, x_max, y_max) [m] encloses the joint in
    which a robot may die, after `death_s`.
    """

    polygon: tuple[tuple[float, float], ...]
    pose: tuple[float, float, float]
    joints: str
    narrowest_m: float
    opening: Bounds
    death_s: float

    def settings(self) -> tuple[str, ...]:
        """Return the settings of a scenario in this building."""
        corners = ",".join(f"[{x},{y}]" for x, y in self.polygon)
        pose = ",".join(str(each) for each in self.pose)
        return f"arena.polygon=[{corners}]", f"base.pose=[{pose}]"

    def death(self) -> str:
        """Return the setting with which the first robot in the opening dies for good."""
        names = ("x_min", "y_min", "x_max", "y_max")
        bounds = ", ".join(f"{name}={value}" for name, value in zip(names, self.opening, strict=True))
        return f'faults=[{{kind="{__name__}:CrashInOpening", at_s={self.death_s}, {bounds}}}]'


class OpeningTable(CrashTable):
    """A rectangle [m] in which a robot dies."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float


class CrashInOpening(ChosenCrash):
    """The first robot in a rectangle crashes for good."""

    Parameters = OpeningTable

    def choose(self, scene: Scene, robots: Ints) -> list[int]:
        """Return the robot of the smallest id in the rectangle."""
        table = self.parameters
        x, y = scene.position[robots].T
        inside = (table.x_min < x) & (x < table.x_max) & (table.y_min < y) & (y < table.y_max)
        chosen: list[int] = robots[inside][:1].tolist()
        return chosen


def small_building(seed: int) -> SmallBuilding:
    """Return the building of a seed."""
    random = np.random.default_rng([77, seed])
    while True:
        drawn = _draw(random)
        if drawn is not None:
            return drawn


def _draw(random: np.random.Generator) -> SmallBuilding | None:
    """Return a drawn building, or None if its rooms overlap or its area is out of bounds."""
    rooms = 2 if random.uniform() < 0.6 else 3
    names, widths, openings = list[str](), list[float](), list[Bounds]()
    first = room = _room(random)
    free = room
    for number in range(1, rooms):
        # Everything is drawn to the east of a room. The second joint leads north: x and y change places.
        swap = number == 2
        start = (first if random.uniform() < 0.5 else room) if swap else room
        name, width = str(random.choice(JOINTS)), _width(random)
        joint, mouth, room = _joint(random, name, width, _swapped(start) if swap else start)
        if swap:
            joint, mouth, room = _swapped(joint), _swapped(mouth), _swapped(room)
        added = joint.union(room)
        if free.buffer(0.03, join_style="mitre").intersection(room).area > 0.0:
            return None
        if added.intersection(free).area > 0.02 or free.intersection(joint).area > width * 0.02 + 1e-9:
            return None
        free = free.union(added)
        names.append(name)
        widths.append(width)
        openings.append(mouth.bounds)
    if random.uniform() < 0.35:
        width, depth = _width(random), random.uniform(0.2, 0.6)
        low_x, low_y, _, high_y = first.bounds
        at = random.uniform(low_y, high_y - width)
        niche = box(low_x - depth, at, low_x + 0.01, at + width)
        names.append("niche")
        widths.append(width)
        free = free.union(niche)
    free = shapely.set_precision(free, 0.001).simplify(0.0005)
    if not isinstance(free, Polygon) or free.interiors or not AREA_M2[0] <= free.area <= AREA_M2[1]:
        return None
    inner = first.buffer(-BASE_M).bounds
    x, y = random.uniform(inner[:2], inner[2:])
    opening = openings[int(random.integers(len(openings)))]
    heading, death_s = float(random.uniform(-np.pi, np.pi)), float(random.uniform(1.0, 60.0))
    corners = tuple((round(a, 3), round(b, 3)) for a, b in free.exterior.coords[:-1])
    return SmallBuilding(
        corners,
        (round(float(x), 3), round(float(y), 3), round(heading, 3)),
        "+".join(names),
        round(min(widths), 4),
        opening,
        round(death_s, 1),
    )


def _room(random: np.random.Generator) -> Polygon:
    return box(0.0, 0.0, *random.uniform(0.9, 1.9, 2))


def _width(random: np.random.Generator) -> float:
    low, high = OPENINGS_M
    return float(random.uniform(low, NARROW_M) if random.uniform() < 0.7 else random.uniform(NARROW_M, high))


def _joint(random: np.random.Generator, name: str, width: float, start: Polygon) -> tuple[Polygon, Polygon, Polygon]:
    """Return a joint to the east of a room, the part of it in which a robot may die, and the room beyond."""
    w, h = random.uniform(0.9, 1.9, 2)
    _, low, right, high = start.bounds
    at = low if name == "corner" else low + random.uniform(0.0, high - low - width)
    if name == "corner" and random.uniform() < 0.5:
        at = high - width
    thick = random.uniform(0.04, 0.25)
    if name in ("door", "corner"):
        joint = box(right - 0.01, at, right + thick + 0.01, at + width)
        below = random.uniform(0.0, h - width)
        if name == "corner" and random.uniform() < 0.5:
            below = 0.0 if random.uniform() < 0.5 else h - width
        room = box(right + thick, at - below, right + thick + w, at - below + h)
        return joint, box(right - 0.05, at, right + thick + 0.05, at + width), room
    length = right + random.uniform(0.05, 0.5)
    if name == "bend":
        top = high + 0.08 if random.uniform() < 0.5 else at + width + random.uniform(0.05, 0.4)
        into = random.uniform(0.0, w - width)
        if top < high + 0.05:  # the next room is beside this one
            into = min(into, length - right - 0.05)
            if into < 0.0:
                into = 0.0
        joint = box(right - 0.01, at, length + width, at + width).union(box(length, at, length + width, top + 0.01))
        room = box(length - into, top, length - into + w, top + h)
        return joint, box(length, at, length + width, at + width), room
    rise = random.uniform(width + 0.03, width + 0.5)
    end = length + width + random.uniform(0.05, 0.3)
    joint = shapely.union_all(
        [
            box(right - 0.01, at, length + width, at + width),
            box(length, at, length + width, at + rise + width),
            box(length, at + rise, end + 0.01, at + rise + width),
        ]
    )
    below = random.uniform(0.0, h - width)
    room = box(end, at + rise - below, end + w, at + rise - below + h)
    low_end = at if random.uniform() < 0.5 else at + rise
    return joint, box(length, low_end, length + width, low_end + width), room


def _swapped(shape: Polygon) -> Polygon:
    """Return a shape with x and y exchanged."""
    return shapely.affinity.affine_transform(shape, [0, 1, 1, 0, 0, 0])
