"""The router's processor time that makes a run look for floods."""

import pytest

from zwerm.run.denial_guard import ANSWER_S_MAX, WINDOW_S, RouterLoad


@pytest.mark.parametrize(
    ("per_answer_s", "wall_s", "suspicious"),
    [
        (0.5 * ANSWER_S_MAX, WINDOW_S, False),  # honest nodes, as fast as they can
        (2.0 * ANSWER_S_MAX, WINDOW_S, True),
        (2.0 * ANSWER_S_MAX, 100.0 * WINDOW_S, False),  # a slow run in real time, whose router sleeps
    ],
)
def test_only_a_busy_router_that_gets_few_answers_for_its_time_is_suspicious(
    per_answer_s: float, wall_s: float, suspicious: bool
) -> None:
    load, answers = RouterLoad(), round(1.01 * WINDOW_S / per_answer_s)
    assert not load.suspicious(3.0, 50.0, 7)  # the time before the run does not count
    assert not load.suspicious(3.0 + 0.9 * WINDOW_S, 50.0 + wall_s, 7)  # too early to judge
    assert load.suspicious(3.0 + 1.01 * WINDOW_S, 50.0 + wall_s, 7 + answers) is suspicious
    assert not load.suspicious(3.0 + 1.1 * WINDOW_S, 50.0 + wall_s, 7 + answers)  # a new window has begun
