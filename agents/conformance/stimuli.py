"""A life to put a controller through: a few dozen observations, plain and odd, always the same ones.

Every reading is one that a sensor could give, with the sensors' own promises kept (an arena has an outline, bearings lie in
(-pi, pi], ids ascend). Packets are another matter: the radio can corrupt them.
"""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from msgspec import Struct

from zwerm.maths.keyed_random import Draws
from zwerm.wire.messages import (
    SENSOR_FIELDS,
    Bearing,
    Contact,
    Displacement,
    FieldSample,
    LandmarkBearing,
    Neighbour,
    Observation,
    Packet,
    Pose,
    encode,
)

# The observation's field that a built-in sensor fills, by the sensor's name in a scenario and by the field's own.
FIELD_OF: Final = {"compass": "compass_rad"} | {field: field for field in SENSOR_FIELDS if field != "extra"}

_PLAIN: Final = 40
_FAR_TICK: Final = 2**31
_MANY: Final = 60


class StimulusSetup(Struct, frozen=True):
    """What the life is lived with: the fields that are filled, the radio's channels, readings of other sensors."""

    fields: tuple[str, ...]
    channels: tuple[str, ...]
    extra: dict[str, tuple[float, ...]]
    dt_s: float


class Stimulus(NamedTuple):
    """One observation, encoded, and what is odd about it."""

    title: str
    sent: bytes


def tell(scene: StimulusSetup) -> list[Stimulus]:
    """Return the whole story, in the order in which it happens."""
    random = Draws(1).generator("conformance-story")
    story: list[Stimulus] = []
    tick = 0

    def add(title: str, readings: dict[str, Any], inbox: Sequence[Packet] = (), ticks: int = 1) -> None:
        nonlocal tick
        extra = dict(scene.extra) or None
        told = {field: readings[field] for field in scene.fields}
        observation = Observation(tick, tick * scene.dt_s, tuple(inbox), extra=extra, **told)
        story.append(Stimulus(title, encode(observation)))
        tick += ticks

    add("nothing to be seen", _nothing())
    for number in range(_PLAIN):
        few = _some(random, int(random.integers(0, 7)))
        # It may have slept for a while.
        add("a plain reading", few, ticks=1 if number % 8 else 23)
    add("everything to be seen", _some(random, _MANY))
    add("the ends of every range", _ends())
    for channel in scene.channels:
        for title, packets in _packets(channel, random).items():
            add(title, _some(random, 3), packets)
    for _ in range(_PLAIN):
        add("a plain reading", _some(random, int(random.integers(0, 7))))
    tick = _FAR_TICK
    add(f"tick {_FAR_TICK}", _some(random, 3))
    add("nothing to be seen", _nothing())
    return story


def _nothing() -> dict[str, Any]:
    return {
        "line_of_sight": False,
        "bearings": (),
        "touch": (),
        "landmarks": (),
        "neighbours": (),
        "field": FieldSample(0.0, 0.0, 0.0),
        "pose": Pose(0.0, 0.0, 0.0),
        "boundary": _SQUARE,
        "odometry": Displacement(0.0, 0.0, 0.0),
        "compass_rad": 0.0,
    }


def _some(random: np.random.Generator, count: int) -> dict[str, Any]:
    """Return a reading of every sensor that sees `count` of whatever it sees."""
    bearings = random.uniform(-math.pi, math.pi, (3, count)).tolist()
    places = random.uniform(-2.0, 2.0, (count, 2)).tolist()
    numbers = random.uniform(-1.0, 1.0, 9).tolist()
    return {
        "line_of_sight": bool(random.integers(0, 2)),
        "bearings": tuple(Bearing(node, bearing) for node, bearing in enumerate(bearings[0], start=1)),
        "touch": tuple(Contact(bearing, math.pi / 8) for bearing in sorted(bearings[1])[:8]),
        "landmarks": tuple(LandmarkBearing(number, bearing) for number, bearing in enumerate(bearings[2])),
        "neighbours": tuple(Neighbour(node, x, y) for node, (x, y) in enumerate(places, start=1)),
        "field": FieldSample(*numbers[:3]),
        "pose": Pose(numbers[3], numbers[4], math.pi * numbers[5]),
        "boundary": tuple((x + numbers[3], y + numbers[4]) for x, y in _SQUARE),
        "odometry": Displacement(0.01 * numbers[6], 0.01 * numbers[7], 0.1 * numbers[8]),
        "compass_rad": math.pi * numbers[5],
    }


def _ends() -> dict[str, Any]:
    """Return readings at the ends of their ranges, and of things at the robot's own place."""
    return {
        "line_of_sight": True,
        "bearings": (Bearing(1, math.pi), Bearing(2, math.pi), Bearing(99_999, 0.0)),
        "touch": (Contact(math.pi, math.pi), Contact(0.0, math.pi)),
        "landmarks": (LandmarkBearing(0, math.pi), LandmarkBearing(99_999, 0.0)),
        "neighbours": (Neighbour(1, 0.0, 0.0), Neighbour(2, 0.0, 0.0), Neighbour(99_999, 1e6, -1e6)),
        "field": FieldSample(1e6, -1e6, 0.0),
        "pose": Pose(-1e6, 1e6, math.pi),
        "boundary": tuple((1e3 * x, 1e3 * y) for x, y in _SQUARE),
        "odometry": Displacement(-1e3, 1e3, math.pi),
        "compass_rad": math.pi,
    }


_SQUARE: Final = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))


def _packets(channel: str, random: np.random.Generator) -> dict[str, list[Packet]]:
    """Return inboxes by what is odd about them."""
    noise = [Packet(channel, random.bytes(size), sender) for sender, size in enumerate((1, 7, 64), start=1)]
    return {
        "an empty packet": [Packet(channel, b"", 1)],
        "packets of noise": noise,
        "a packet of nobody": [Packet(channel, b"\x01", None)],
        "the same packet twice": [Packet(channel, b"\x93\x01\x02\x03", 2)] * 2,
        "a long packet": [Packet(channel, bytes(20_000), 3)],
        "many packets": [Packet(channel, bytes([number]), number + 1) for number in range(_MANY)],
    }
