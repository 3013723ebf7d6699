"""Random faults: a schedule drawn from rates, in the same tables that a person would write.

Faults of a kind come as a Poisson process with its rate over the whole swarm; each lasts an exponential time of mean
`mean_s`. Every kind has a stream of randomness of its own, so that adding a kind changes nobody else's faults.
"""

from typing import Any, Final

import numpy as np

from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import OpenTable
from zwerm.world.arena.arena import Arena
from zwerm.world.faults.sensing import contacts_of

SECONDS_PER_H: Final = 3_600.0

_OF_NODES: Final = ("crash", "pause", "slow")
_OF_THE_RADIO: Final = ("partition", "jam", "blackout", "cut")
_OF_SENSORS: Final = ("camera_blackout", "dead_beacon", "stuck_touch")
KINDS: Final = (*_OF_NODES, *_OF_THE_RADIO, *_OF_SENSORS)

# A slow node takes so many ticks over an answer, a jammer reaches this part of the arena's diagonal: from, to.
_SLOW_TICKS: Final = (2, 10)
_JAM_FRACTION: Final = (0.05, 0.25)


def scheduled(scenario: Scenario, seed: int, arena: Arena) -> list[tuple[str, OpenTable]]:
    """Return the faults of a run, each as (path, table): the scenario's, then those drawn for its seed, by time.

    Raises ScenarioError where random faults are asked for that cannot be.
    """
    written = [(f"faults.{index}", table) for index, table in enumerate(scenario.faults)]
    drawn = draw(scenario, seed, arena)
    return [*written, *((f"random_faults.{index}", table) for index, table in enumerate(drawn))]


def draw(scenario: Scenario, seed: int, arena: Arena) -> list[OpenTable]:
    """Return the random faults of a run, by time."""
    table = scenario.random_faults
    if table is None:
        return []
    wrong: list[str] = []
    found: list[dict[str, Any]] = []
    draws = Draws(seed if table.seed is None else table.seed)
    for kind in KINDS:
        per_h = getattr(table, f"{kind}_per_h")
        if not per_h:
            continue
        reason = _impossible(kind, scenario)
        if reason:
            wrong.append(f"random_faults.{kind}_per_h: {reason}, got {per_h:g}")
            continue
        stream = draws.generator(f"random-faults/{kind}")
        at_s = 0.0
        while round(at_s := at_s + stream.exponential(SECONDS_PER_H / per_h), 3) < scenario.time.duration_s:
            for_s = max(scenario.time.dt_s, stream.exponential(table.mean_s))
            what = _one(kind, stream, scenario, arena)
            found.append({"kind": kind, "at_s": round(at_s, 3), "for_s": round(for_s, 3), **what})
    if wrong:
        raise ScenarioError(wrong)
    found.sort(key=lambda fault: float(fault["at_s"]))
    return [OpenTable.model_validate(fault) for fault in found]


def _impossible(kind: str, scenario: Scenario) -> str:
    """Return why there can be no such fault in this scenario, or an empty string."""
    if kind in ("jam", "partition", "cut") and scenario.radio is None:
        return "the scenario has no radio"
    if kind == "blackout" and scenario.radio is None and scenario.coordinator is None:
        return "the scenario has no radio"
    if kind in ("partition", "cut") and scenario.robots.count < 2:
        return "a robot alone has no links"
    sensors = {sensor.kind for sensor in scenario.robots.sensors}
    if kind == "stuck_touch" and "touch" not in sensors:
        return "the robots have no touch sensor"
    return ""


def _one(kind: str, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any]:
    """Return what is particular to one fault of this kind."""
    count = scenario.robots.count
    if kind in _OF_NODES:
        node = int(stream.integers(count + (scenario.coordinator is not None)))
        nodes = {"nodes": ["coordinator" if node == count else node]}
        return nodes | ({"every_ticks": int(stream.integers(*_SLOW_TICKS))} if kind == "slow" else {})
    if kind == "partition":
        chosen = np.flatnonzero(stream.random(count) < stream.random())
        return {"channel": "robots", "groups": [chosen.tolist() or [int(stream.integers(count))]]}
    if kind == "jam":
        xmin, ymin, xmax, ymax = arena.bounds
        place = [round(float(stream.uniform(*ends)), 3) for ends in ((xmin, xmax), (ymin, ymax))]
        reach = float(stream.uniform(*_JAM_FRACTION)) * float(np.hypot(xmax - xmin, ymax - ymin))
        return {"channel": "robots", "center_m": place, "radius_m": round(reach, 3)}
    if kind == "blackout":
        channels = [name for name, there in (("robots", scenario.radio), ("uplink", scenario.coordinator)) if there]
        return {"channel": channels[int(stream.integers(len(channels)))]}
    if kind == "cut":
        sender, receiver = stream.choice(count, 2, replace=False).tolist()
        return {"channel": "robots", "senders": [sender], "receivers": [receiver], "both": bool(stream.integers(2))}
    robot = {"robots": [int(stream.integers(count))]}
    if kind == "stuck_touch":
        switches = len(contacts_of(scenario))
        return robot | {"switch": int(stream.integers(switches)), "closed": bool(stream.integers(2))}
    return robot
