"""Stimuli of the conformance kit: about a hundred observations, ordinary and unusual, always the same ones.

Every sensor brings its own stimuli (`rest`, `stimulus` and `extremes` of its class); the classes are found through the
catalogue. Packets may hold any bytes, because the radio can corrupt them.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import import_module
from typing import Any, Final, NamedTuple

import numpy as np

from zwerm.catalogue import SENSOR_LOOKUP, SENSORS
from zwerm.maths.keyed_random import Draws
from zwerm.wire.messages import SENSOR_FIELDS, Observation, Packet, encode

_FIELDS: Final = frozenset(SENSOR_FIELDS) - {"extra"}

_PLAIN: Final = 40
_FAR_TICK: Final = 2**31
_MANY: Final = 60


class StimulusSetup(NamedTuple):
    """Classes of the sensors, channels of the radio, readings of sensors that bring no stimuli, and the tick's length."""

    sensors: tuple[Any, ...]
    channels: tuple[str, ...]
    extra: Mapping[str, tuple[float, ...]]
    dt_s: float


class Stimulus(NamedTuple):
    """One encoded observation and its description."""

    title: str
    sent: bytes


def make_stimuli(chosen: StimulusSetup) -> list[Stimulus]:
    """Return all stimuli in ascending order of ticks."""
    random = Draws(1).generator("conformance-stimuli")
    stimuli: list[Stimulus] = []
    tick = 0

    def add(title: str, read: Callable[[Any], Any], inbox: Sequence[Packet] = (), ticks: int = 1) -> None:
        nonlocal tick
        readings = {sensor.field: read(sensor) for sensor in chosen.sensors}
        filled = {field: reading for field, reading in readings.items() if field in _FIELDS}
        extra = {field: reading for field, reading in readings.items() if field not in _FIELDS} | dict(chosen.extra)
        observation = Observation(tick, tick * chosen.dt_s, tuple(inbox), extra=extra or None, **filled)
        stimuli.append(Stimulus(title, encode(observation)))
        tick += ticks

    def at_rest(sensor: Any) -> Any:
        return sensor.rest()

    def some(count: int) -> Callable[[Any], Any]:
        return lambda sensor: sensor.stimulus(random, count)

    add("nothing to be seen", at_rest)
    for number in range(_PLAIN):
        few = some(int(random.integers(0, 7)))
        # Ticks may be missing: the controller can sleep.
        add("a plain reading", few, ticks=1 if number % 8 else 23)
    add("everything to be seen", some(_MANY))
    add("the ends of every range", lambda sensor: sensor.extremes())
    for channel in chosen.channels:
        for title, packets in _packets(channel, random).items():
            add(title, some(3), packets)
    for _ in range(_PLAIN):
        add("a plain reading", some(int(random.integers(0, 7))))
    tick = _FAR_TICK
    add(f"tick {_FAR_TICK}", some(3))
    add("nothing to be seen", at_rest)
    return stimuli


@cache
def sensor_class(name: str) -> Any:
    """Return the class of a sensor by its kind, its field or `module:Class`, or None where there is none."""
    module, _, function = SENSOR_LOOKUP.partition(":")
    find = getattr(import_module(module), function)
    if name in SENSORS or ":" in name:
        try:
            return find(name)
        except ValueError:
            return None
    return next((found for found in map(find, SENSORS) if found.field == name), None)


def _packets(channel: str, random: np.random.Generator) -> dict[str, list[Packet]]:
    """Return inboxes by their description."""
    noise = [Packet(channel, random.bytes(size), sender) for sender, size in enumerate((1, 7, 64), start=1)]
    return {
        "an empty packet": [Packet(channel, b"", 1)],
        "packets of noise": noise,
        "a packet without a sender": [Packet(channel, b"\x01", None)],
        "the same packet twice": [Packet(channel, b"\x93\x01\x02\x03", 2)] * 2,
        "a long packet": [Packet(channel, bytes(20_000), 3)],
        "many packets": [Packet(channel, bytes([number]), number + 1) for number in range(_MANY)],
    }
