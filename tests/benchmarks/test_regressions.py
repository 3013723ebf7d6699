"""The comparison of speeds between commits: its interval, and what it names a regression."""

import numpy as np

from benchmarks.speed.regressions import CASES, MORE, interval
from zwerm.scenario.load import load


def test_the_interval_of_a_median_is_by_ranks_and_holds_it_19_times_of_20() -> None:
    assert interval([float(each) for each in range(1, 10)]) == (2.0, 8.0)
    assert interval([3.0, 1.0, 2.0]) == (1.0, 3.0)
    random = np.random.Generator(np.random.Philox(1))
    held = 0
    for _ in range(400):
        low, high = interval(random.lognormal(0.0, 0.2, 11).tolist())
        held += low <= 1.0 <= high
    assert 0.93 < held / 400 < 1.0


def test_every_case_is_a_scenario_with_settings_that_it_has() -> None:
    for case in (CASES | MORE).values():
        assert not case.scenario or load(case.scenario, case.overrides).robots.count > 1
