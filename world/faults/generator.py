"""Random schedules: faults at rates that a scenario gives, as tables in the same form as those of a scenario.

Faults of a kind are a Poisson process with its rate over the whole swarm; each lasts an exponential time of mean `mean_s`.
Every kind has a random stream of its own, so that another kind changes no fault of this one.
"""

from typing import Any, Final

from zwerm.catalogue import FAULTS
from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import OpenTable
from zwerm.world.arena.arena import Arena
from zwerm.world.faults import Fault
from zwerm.world.faults.registry import find

SECONDS_PER_H: Final = 3_600.0


def scheduled(scenario: Scenario, seed: int, arena: Arena) -> list[tuple[str, OpenTable]]:
    """Return the faults of a run, each as (path, table): those of the scenario, then the random ones by time.

    Raises ScenarioError if the scenario has rates of random faults that cannot occur.
    """
    written = [(f"faults.{index}", table) for index, table in enumerate(scenario.faults)]
    random = random_faults(scenario, seed, arena)
    return [*written, *((f"random_faults.{index}", table) for index, table in enumerate(random))]


def random_faults(scenario: Scenario, seed: int, arena: Arena) -> list[OpenTable]:
    """Return the random faults of a run, by time.

    Raises ScenarioError, a line for each rate of a kind that cannot occur.
    """
    table = scenario.random_faults
    if table is None:
        return []
    wrong: list[str] = []
    found: list[dict[str, Any]] = []
    draws = Draws(seed if table.seed is None else table.seed)
    rates = {kind: per_h for kind, per_h in table.rates_per_h.items() if per_h}
    # Faults at the same time are in the order of the catalogue, and after these in the order of names.
    built_in = {kind: order for order, kind in enumerate(FAULTS)}
    for kind in sorted(rates, key=lambda kind: (built_in.get(kind, len(built_in)), kind)):
        try:
            fault = _possible(kind, scenario)
        except ValueError as error:
            wrong.append(f"random_faults.{kind}_per_h: {error}, got {rates[kind]:g}")
            continue
        stream = draws.generator(f"random-faults/{kind}")
        at_s = 0.0
        while round(at_s := at_s + stream.exponential(SECONDS_PER_H / rates[kind]), 3) < scenario.time.duration_s:
            for_s = max(scenario.time.dt_s, stream.exponential(table.mean_s))
            parameters = fault.random_parameters(stream, scenario, arena) or {}
            end = {"for_s": round(for_s, 3)} if fault.lasts else {}
            found.append({"kind": kind, "at_s": round(at_s, 3), **end, **parameters})
    if wrong:
        raise ScenarioError(wrong)
    found.sort(key=lambda fault: float(fault["at_s"]))
    return [OpenTable.model_validate(fault) for fault in found]


def _possible(kind: str, scenario: Scenario) -> type[Fault]:
    """Return the fault class that `kind` names. Raises ValueError with the reason if it cannot occur at random."""
    fault = find(kind)
    if _implementation(fault) is _implementation(Fault):
        raise ValueError("there are no random faults of this kind")
    reason = fault.impossible(scenario)
    if reason:
        raise ValueError(reason)
    return fault


def _implementation(fault: type[Fault]) -> Any:
    """Return the function behind `random_parameters`, to compare with that of the base class."""
    return getattr(fault.random_parameters, "__func__", fault.random_parameters)
