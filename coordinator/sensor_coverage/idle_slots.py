"""Idle slots: a robot stands there after a walk, and is not needed. The deployment goes on as if it were not there."""

from collections.abc import Collection, Iterable, Mapping

from zwerm.agents.sensor_coverage.frontier.wall_proof import WalkPoint


def still_idle(idle: Mapping[int, None], neighbours: Mapping[int, Collection[int]]) -> dict[int, None]:
    """Return the idle slots without those that no other slot sees, and without the idle slots in sight of these.

    A robot that no other one sees stands where the proof has seen nothing.
    """
    apart = [slot for slot in idle if all(each in idle for each in neighbours.get(slot, ()))]
    needed = {*apart, *(each for slot in apart for each in neighbours.get(slot, ()))}
    return {slot: None for slot in idle if slot not in needed}


def beside_others(idle: Mapping[int, None], stations: Iterable[Collection[int]]) -> dict[int, None]:
    """Return the idle slots without those that a station sees, if it sees no others: the station is not to begin again.

    `stations` has the slots that each station sees.
    """
    needed = {slot for seen in stations if all(each in idle for each in seen) for slot in seen}
    return {slot: None for slot in idle if slot not in needed}


def without_witnesses(idle: Mapping[int, None], points: Iterable[WalkPoint]) -> dict[int, None]:
    """Return the idle slots without those that saw a point of a walk which no other slot saw."""
    needed = {slot for point in points if all(each in idle for each in point.seen) for slot in point.seen}
    return {slot: None for slot in idle if slot not in needed}
