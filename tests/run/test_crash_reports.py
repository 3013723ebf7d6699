"""The report of a run about programs that ended: the way, the program, and the effect on the run."""

import pytest
from support import scenario

from zwerm.run.runner import Runner, run

EVERYBODY = [{"kind": "crash", "nodes": [0, 1, 2, 3], "at_s": 0.5}]


def test_a_process_that_ends_is_reported_with_its_exit_code(nothing_left: None) -> None:
    result = run(scenario(robots={"controller": "ends:Leaves"}))
    assert result.reason == "node 2 crashed at tick 5: its process ended with exit code 9"


@pytest.mark.parametrize("runner", ["inline", "processes"])
def test_of_several_crashes_at_one_tick_the_lowest_node_is_named(runner: Runner, nothing_left: None) -> None:
    result = run(scenario(robots={"controller": "ends:AllRaise"}), runner=runner)
    assert result.reason == "node 0 crashed at tick 4: ValueError: no way (ends.py:36, in step)"
    assert result.crashed == [0, 1, 2, 3]


@pytest.mark.parametrize("runner", ["inline", "processes"])
def test_an_error_whose_text_cannot_be_made_is_named_by_its_kind(runner: Runner, nothing_left: None) -> None:
    result = run(scenario(robots={"controller": "ends:RaisesWithoutText"}), runner=runner)
    assert result.reason.startswith("node 0 crashed at tick 0: NoTextError: its text cannot be made (ends.py:")
    assert result.crashed == [0, 1, 2, 3]


def test_a_run_that_loses_every_robot_has_failed() -> None:
    lost = run(scenario(robots={"controller": "ends:AllRaise", "on_crash": "continue"}), runner="inline")
    assert (lost.outcome, lost.reason, lost.ticks) == ("failed", "every robot was lost", 5)
    killed = run(scenario(faults=EVERYBODY), runner="inline")
    assert (killed.outcome, killed.reason) == ("failed", "every robot was lost")
    restarted = run(scenario(faults=[EVERYBODY[0] | {"for_s": 0.5}]), runner="inline")
    assert restarted.outcome == "time-limit", "robots that return are not lost"


def test_a_controller_that_hangs_inline_is_interrupted_and_named_with_its_line() -> None:
    result = run(scenario(robots={"controller": "ends:HangsInline"}, time={"straggler_s": 0.2}), runner="inline")
    assert result.outcome == "failed"
    assert result.reason.startswith("node 1 crashed at tick 3: HangError: no answer within 0.2 s (ends.py:")
