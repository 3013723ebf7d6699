"""Shrinking: from a schedule of faults under which a run fails to a smallest one under which it still fails.

Delta debugging (Zeller, Hildebrandt: Simplifying and isolating failure-inducing input. IEEE TSE 28, 2002, ddmin) over
the faults of the schedule, those drawn at random included. The remaining schedule is 1-minimal: without any one of its
faults the run no longer fails. Trials run inline, which gives what processes would; equal schedules are tried once.
"""

import operator
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

from zwerm.errors import ScenarioError
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.scenario.load import validate
from zwerm.scenario.tables import Scenario

Faults = tuple[dict[str, Any], ...]

_OPERATORS: Final[dict[str, Callable[[float, float], bool]]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
_CONDITION: Final = re.compile(r"\s*(\w+)\s*(<=|>=|==|!=|<|>)\s*([\w.+-]+)\s*")


@dataclass(frozen=True, slots=True)
class Failing:
    """The condition that counts as failing: a metric, `ticks`, `sim_s` or `outcome`, compared with a value."""

    name: str
    sign: str
    value: str

    def of(self, result: RunResult) -> bool:
        """Return whether a run failed. Raises ScenarioError where it has no such metric."""
        if self.name == "outcome":
            return (result.outcome == self.value) == (self.sign == "==")
        measured = {**result.metrics, "ticks": float(result.ticks), "sim_s": result.sim_s}
        if self.name not in measured:
            known = ", ".join(["outcome", *measured])
            raise ScenarioError([f"--failing: expected one of {known}, got {self.name}"])
        return _OPERATORS[self.sign](measured[self.name], float(self.value))


def parse_failing(text: str) -> Failing:
    """Return the condition `metric < value`. Raises ScenarioError where it is none."""
    found = _CONDITION.fullmatch(text)
    if found is None:
        raise ScenarioError([f"--failing: expected a condition such as 'cell_coverage_fraction < 0.5', got {text!r}"])
    failing = Failing(*found.groups())
    if failing.name == "outcome":
        if failing.sign not in ("==", "!="):
            raise ScenarioError([f"--failing: an outcome is == or != another, got {text!r}"])
        return failing
    try:
        float(failing.value)
    except ValueError:
        raise ScenarioError([f"--failing: expected a number after {failing.sign}, got {failing.value!r}"]) from None
    return failing


class Shrinker:
    """Looks for a smallest failing schedule of `scenario` under one seed; `tried` counts the runs that took."""

    def __init__(
        self, scenario: Scenario, seed: int, failing: Failing, progress: Callable[[int, int], None] | None = None
    ) -> None:
        """`progress` gets, after each run, the number of runs, and the number of faults in the smallest failing schedule."""
        self._scenario = scenario
        self._seed = seed
        self._failing = failing
        self._progress = progress or (lambda tried, faults: None)
        self._known: dict[str, bool] = {}
        self._fewest = 0
        self.tried = 0

    def shrink(self) -> Faults:
        """Return the faults of a smallest schedule that still fails.

        Raises ScenarioError where the run does not fail with all of them, or fails without any.
        """
        first = run(self._scenario, self._seed, "inline")
        self.tried += 1
        faults: Faults = tuple(first.faults)
        self._fewest = len(faults)
        place = self._scenario.place
        if not faults:
            raise ScenarioError([f"{place}: faults: there are none to shrink"])
        if not self._failing.of(first):
            raise ScenarioError([f"{place}: with seed {self._seed} and all {len(faults)} faults the run does not fail"])
        if self._fails(()):
            raise ScenarioError([f"{place}: with seed {self._seed} the run fails without any fault"])
        return self._ddmin(faults)

    def _ddmin(self, faults: Faults) -> Faults:
        parts = 2
        while len(faults) >= 2:
            cuts = [len(faults) * number // parts for number in range(parts + 1)]
            pieces = [faults[a:b] for a, b in pairwise(cuts)]
            rests = [faults[:a] + faults[b:] for a, b in pairwise(cuts)]
            smaller = next((piece for piece in pieces if self._fails(piece)), None)
            if smaller is not None:
                faults, parts = smaller, 2
                continue
            smaller = next((rest for rest in rests if parts > 2 and self._fails(rest)), None)
            if smaller is not None:
                faults, parts = smaller, max(parts - 1, 2)
                continue
            if parts >= len(faults):
                break
            parts = min(len(faults), 2 * parts)
        return faults

    def _fails(self, faults: Sequence[dict[str, Any]]) -> bool:
        key = repr(faults)
        if key not in self._known:
            self._known[key] = self._failing.of(run(with_faults(self._scenario, faults), self._seed, "inline"))
            self.tried += 1
            if self._known[key] and faults:
                self._fewest = min(self._fewest, len(faults))
            self._progress(self.tried, self._fewest)
        return self._known[key]


def with_faults(scenario: Scenario, faults: Sequence[dict[str, Any]]) -> Scenario:
    """Return `scenario` with exactly these faults, and none drawn at random."""
    tables = tables_of(scenario) | {"faults": list(faults)}
    tables.pop("random_faults", None)
    return validate(tables, scenario.place, scenario.folder)


def tables_of(scenario: Scenario) -> dict[str, Any]:
    """Return the tables of a scenario as its file might have them, without what is at its default."""
    return scenario.model_dump(exclude_unset=True, exclude_none=True)
