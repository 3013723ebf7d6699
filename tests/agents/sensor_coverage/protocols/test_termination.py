"""The base alone takes the census: when it ends the deployment, and how often it has failed attempts repeated before."""

from collections.abc import Callable

import numpy as np
import pytest

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.protocols.ending.completion_census import CompletionProtocol
from zwerm.agents.sensor_coverage.protocols.ending.termination import (
    COVERED,
    MISSING_TICKS,
    SEARCHES_MAX,
    UNPROVEN,
    Termination,
)


def ended(open_arcs: Callable[[int], int]) -> tuple[str, int, int]:
    """Let the base be quiet until the end; return the outcome, the tick, and the searches. Searches change the open arcs."""
    completion = CompletionProtocol(Setup(0, "base", 0.1, (), bytes(16)), np.random.default_rng(1), base=True)
    termination = Termination(completion)
    tick, outcome = 0, ""
    while not outcome:
        tick += 1
        completion.update(tick, (), 0, False, (), open_arcs(completion.search))
        completion.poll(tick)
        outcome = termination.quiet(tick, 1)
    return outcome, tick, completion.search


def test_without_open_arcs_the_deployment_ends_without_a_search() -> None:
    outcome, tick, searches = ended(lambda searches: 0)
    assert (outcome, searches) == (COVERED, 0)
    assert tick < MISSING_TICKS


@pytest.mark.parametrize("closed_by", range(1, SEARCHES_MAX + 1))
def test_arcs_that_close_when_attempts_are_repeated_end_the_deployment_as_covered(closed_by: int) -> None:
    outcome, _, searches = ended(lambda searches: 2 if searches < closed_by else 0)
    assert (outcome, searches) == (COVERED, closed_by)


def test_arcs_that_stay_open_end_the_deployment_as_unproven() -> None:
    outcome, tick, searches = ended(lambda searches: 2)
    assert (outcome, searches) == (UNPROVEN, SEARCHES_MAX)
    assert tick > SEARCHES_MAX * MISSING_TICKS
