"""Sensors: what a robot may know of the scene. One file a sensor, each with its noise model; `registry` names them.

Every sensor reads the truth, adds its noise from keyed draws, and returns what crosses the wire. Robots that are not
present are neither sensed nor read. Which robots are read changes no reading, but for `odometry`, which speaks of the
time since. A tick may be read more than once, and not always of the same robots: what a sensor remembers is what it was
asked last.
"""

import dataclasses
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from zwerm.scenario.tables import Table
from zwerm.world.arena.arena import Arena
from zwerm.world.fields.field import Field
from zwerm.world.geometry.visibility import Visibility
from zwerm.world.scene import Floats, Ints, Scene

Item = TypeVar("Item")


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """What stays the same all through a run and a sensor may need: given to its constructor.

    `count` robots have ids below it; `visibility` is shared, so that no line of sight is looked along twice.
    """

    arena: Arena
    count: int
    visibility: Visibility = dataclasses.field(default_factory=Visibility)
    landmarks: Floats = dataclasses.field(default_factory=lambda: np.empty((0, 2)))  # (l, 2) [m]
    field: Field | None = None


class Sensor(Protocol):
    """A sensor that every robot of the swarm carries.

    `field` is the field of `Observation` that it fills; any other name is a key of the field `extra`.
    """

    field: ClassVar[str]
    Parameters: ClassVar[type[Table]]

    def __init__(self, parameters: Any, surroundings: Surroundings) -> None:
        """Take an instance of `Parameters`. Raises ValueError, one line, if the surroundings lack what it needs."""

    def read(self, scene: Scene, robots: Ints) -> Sequence[Any]:
        """Return one reading for each of `robots` (ascending ids of present robots), vectorised over all of them."""


def portions(items: Iterable[Item], ends: Ints) -> list[tuple[Item, ...]]:
    """Return `items` cut before each of `ends`, which ascend to the end of items: one tuple for each robot."""
    together = tuple(items)
    return [together[start:end] for start, end in pairwise([0, *ends.tolist()])]


def in_body_frames(dx: Floats, dy: Floats, heading: Floats, whose: Ints) -> tuple[Floats, Floats]:
    """Return the vectors (dx, dy) of the arena's frame in the body frames of the robots `whose`, of (n,) headings [rad].

    There is one robot for each of the vectors, or for each column of them.
    """
    if not heading.any():
        return dx, dy
    heading = heading.take(whose)
    cos, sin = np.cos(heading), np.sin(heading)
    return cos * dx + sin * dy, cos * dy - sin * dx
