"""Sums of floats: the same in every version of Python, so that traces are."""

import builtins
import sys
from collections.abc import Iterable
from typing import Any

import pytest

from zwerm import run
from zwerm.maths.sums import added

HALL = ("arena.size_m=[2.0,1.5]", "robots.count=20", "base.pose=[0.2,0.5,0.3]", "time.duration_s=80")
ROOMS = ("zwerm.agents.", "zwerm.coordinator.", "zwerm.maths.", "zwerm.world.")


def test_values_are_added_one_after_the_other_without_compensation() -> None:
    assert added([1e16, 1.0, -1e16]) == 0.0
    assert added([0.1] * 10) == 0.9999999999999999
    assert added([]) == 0.0


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("agreement-averaging", ("time.duration_s=2",)),
        ("agreement-lease", ()),
        ("computation-free-maze", ("time.duration_s=2",)),
        ("gossip-max", ("time.duration_s=2",)),
        ("landmark-complex", ("time.duration_s=5",)),
        ("landmark-random-walk", ("time.duration_s=5",)),
        ("robot-teams", ("time.duration_s=20",)),
        ("sensor-coverage", HALL),
        ("sensor-coverage", (*HALL, "services.path=gradient", "services.redundancy=link")),
        ("voronoi-radio", ("time.duration_s=1",)),
    ],
)
def test_no_float_is_added_by_the_sum_of_python(
    scenario: str, settings: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    python_sum, found = builtins.sum, []

    def watched(values: Iterable[Any], /, start: Any = 0) -> Any:
        items = list(values)
        frame = sys._getframe(1)
        if frame.f_globals["__name__"].startswith(ROOMS) and any(isinstance(each, float) for each in items):
            found.append(f"{frame.f_code.co_filename}:{frame.f_lineno}")
        return python_sum(items, start)

    monkeypatch.setattr(builtins, "sum", watched)
    run(scenario, seed=1, runner="inline", overrides=settings)
    assert not found, "the last bits depend on the version of Python: use zwerm.maths.sums.added"
