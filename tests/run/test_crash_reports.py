"""The report of a run about programs that ended: the way, the program, and the effect on the run."""

import pytest
from support import scenario

from zwerm.errors import ZwermError
from zwerm.run import hang_guard
from zwerm.run.runner import Runner, run

NOT_MADE = r"^a controller was not made within 0\.2 s: it runs .*ends\.py:\d+, in __init__$"
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


@pytest.fixture
def made_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hang_guard, "MADE_S_MAX", 0.2)


@pytest.mark.parametrize("runner", ["inline", "processes"])
def test_a_constructor_that_does_not_return_is_named_with_its_line(
    runner: Runner, nothing_left: None, made_soon: None
) -> None:
    with pytest.raises(ZwermError, match=NOT_MADE):
        run(scenario(robots={"controller": "ends:NeverMade"}), runner=runner)


def test_a_constructor_that_does_not_return_after_a_restart_is_named_with_its_line(made_soon: None) -> None:
    restart = [{"kind": "restart", "nodes": [1], "at_s": 0.5}]
    with pytest.raises(ZwermError, match=NOT_MADE):
        run(scenario(robots={"controller": "ends:NeverMadeAgain"}, faults=restart), runner="inline")


def test_a_controller_that_hangs_inline_after_a_restart_is_named() -> None:
    restart = [{"kind": "restart", "nodes": [0], "at_s": 0.1}]
    tables = scenario(robots={"controller": "ends:HangsInline"}, time={"straggler_s": 0.2}, faults=restart)
    assert run(tables, runner="inline").reason.startswith("node 1 crashed at tick 3: HangError: no answer within 0.2 s")


def test_a_controller_that_hangs_inline_is_interrupted_and_named_with_its_line() -> None:
    result = run(scenario(robots={"controller": "ends:HangsInline"}, time={"straggler_s": 0.2}), runner="inline")
    assert result.outcome == "failed"
    assert result.reason.startswith("node 1 crashed at tick 3: HangError: no answer within 0.2 s (ends.py:")
