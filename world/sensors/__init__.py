"""Sensors: the parts of the scene that a robot may observe. One file per sensor, with its noise model.

Every sensor reads the truth, adds its noise from keyed draws, and returns the values that cross the wire. Robots that are not
present are neither sensed nor read. The set of robots that are read changes no reading, except for `odometry`, whose reading
covers the time since the last one. A tick may be read more than once, and not always for the same robots: a sensor keeps the
state of its last reading.
"""

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, ClassVar, TypeVar

import msgspec
import numpy as np

from zwerm.scenario.types import Table
from zwerm.world.arena.arena import Arena
from zwerm.world.fields import Field
from zwerm.world.geometry.visibility import Visibility
from zwerm.world.scene import Floats, Ints, Scene

Item = TypeVar("Item")


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """The constant data of a run that a sensor may need; its constructor gets them.

    `count` robots have ids below it; `visibility` is shared by all sensors, so that each line of sight is tested once.
    """

    arena: Arena
    count: int
    visibility: Visibility = dataclasses.field(default_factory=Visibility)
    landmarks: Floats = dataclasses.field(default_factory=lambda: np.empty((0, 2)))  # (l, 2) [m]
    field: Field | None = None


class Sensor(ABC):
    """A sensor that every robot of the swarm carries: the base class of the plug-in kind `sensor`.

    `field` is the field of `Observation` that it fills; any other name is a key of the field `extra`. A subclass states
    all that other parts need to know about its readings: the wake event, the effects of faults, and stimuli for tests.
    """

    field: ClassVar[str]
    Parameters: ClassVar[type[Table]] = Table
    # Parameters of an example. The tests try the sensor with them, and the reference page shows them.
    example: ClassVar[Mapping[str, Any]] = {}

    # The field of `Wake` that asks for an observation when the `signature` of the reading changes, or "".
    wake_event: ClassVar[str] = ""
    # The reading during a camera blackout, or None where the sensor is no camera.
    dark: ClassVar[Any] = None
    # A dead beacon is missing from the reading: its items are robots.
    sees_beacons: ClassVar[bool] = False
    # The reading is a tuple of items, of which a fault may hide one or add a phantom.
    has_items: ClassVar[bool] = False
    # The reading depends on poses and on nothing else: while no body moves, it stays the same. An instance may set it.
    steady: bool = False
    # The reading has floats, to which a fault may add noise and bias.
    has_floats: ClassVar[bool] = True

    @abstractmethod
    def __init__(self, parameters: Any, surroundings: Surroundings) -> None:
        """Take an instance of `Parameters`. Raises ValueError, one line, if the surroundings lack what it needs."""

    @abstractmethod
    def read(self, scene: Scene, robots: Ints) -> Sequence[Any]:
        """Return one reading for each of `robots` (ascending ids of present robots), vectorised over all of them."""

    @staticmethod
    def signature(reading: Any) -> Hashable:
        """Return the part of a reading whose change is the sensor's wake event."""
        return None

    def reach_at_rest_m(self, scene: Scene) -> float | None:
        """Return a distance [m] if a reading `rest` stays until its robot moves, or a body does that is closer then.

        None means that anything may change it.
        """
        return None

    def item_id(self, item: Any) -> int:
        """Return the number that identifies an item of a reading: by default its first field."""
        return int(msgspec.structs.astuple(item)[0])

    def phantom(self, robot: int, known: Collection[int], uniform: Callable[[str], float]) -> Any:
        """Return an item that is not there and whose id is not in `known`, or None where there is no such id.

        `uniform` draws a number in [0, 1) for a purpose.
        """
        return None

    @classmethod
    def rest(cls) -> Any:
        """Return the reading where there is nothing to sense, for the wake rule and the conformance kit."""
        return (0.0,)

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> Any:
        """Return a plain reading with `count` items, where it has items, for the conformance kit."""
        return (float(random.uniform(-1.0, 1.0)),)

    @classmethod
    def extremes(cls) -> Any:
        """Return a reading at the ends of its ranges, for the conformance kit."""
        return (1e6,)


def chosen(ids: Iterable[int], known: Collection[int], uniform: Callable[[str], float]) -> int | None:
    """Return a random one of `ids` that is not in `known`, or None where there is none."""
    others = [number for number in ids if number not in known]
    return others[int(uniform("which") * len(others))] if others else None


def random_angle(uniform: Callable[[str], float]) -> float:
    """Return a random angle [rad] in [-pi, pi)."""
    return math.pi * (2.0 * uniform("where") - 1.0)


def portions(items: Iterable[Item], ends: Ints) -> list[tuple[Item, ...]]:
    """Return `items` cut before each of `ends`, which ascend to the end of items: one tuple for each robot."""
    together = tuple(items)
    return [together[start:end] for start, end in pairwise([0, *ends.tolist()])]


def in_body_frames(dx: Floats, dy: Floats, heading: Floats, whose: Ints) -> tuple[Floats, Floats]:
    """Return the vectors (dx, dy) of the arena's frame in the body frames of the robots `whose`, of (n,) headings [rad].

    There is one robot for each of the vectors, or for each column of them.
    """
    theirs = heading.take(whose)
    if not (theirs.any() or heading.any()):
        return dx, dy
    cos, sin = np.cos(theirs), np.sin(theirs)
    return cos * dx + sin * dy, cos * dy - sin * dx
