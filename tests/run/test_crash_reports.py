"""The report of a run about programs that ended: the way, the program, and the effect on the run."""

import re

import pytest
from command_line import zwerm
from support import ROBOTS, scenario

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
    assert result.reason == "node 0 crashed at tick 4: ValueError: no way (ends.py:40, in step)"
    assert result.crashed == [0, 1, 2, 3]


@pytest.mark.parametrize("runner", ["inline", "processes"])
def test_an_error_whose_text_cannot_be_made_is_named_by_its_kind(runner: Runner, nothing_left: None) -> None:
    result = run(scenario(robots={"controller": "ends:RaisesWithoutText"}), runner=runner)
    assert result.reason.startswith("node 0 crashed at tick 0: NoTextError: its text cannot be made (ends.py:")
    assert result.crashed == [0, 1, 2, 3]


@pytest.mark.parametrize("runner", ["inline", "processes"])
def test_a_controller_that_forks_is_named_with_its_line(runner: Runner, nothing_left: None) -> None:
    result = run(scenario(robots={"controller": "ends:ForksInStep"}), runner=runner)
    reason = r"node 1 crashed at tick 3: RuntimeError: a controller must not fork, .* \(ends\.py:\d+, in step\)"
    assert re.fullmatch(reason, result.reason), result.reason


def test_a_process_that_was_forked_past_python_does_not_act_for_its_robot(nothing_left: None) -> None:
    for _ in range(5):  # which of both processes gets a message is chance
        result = run(scenario(robots={"controller": "ends:ForksPastPython"}, time={"straggler_s": 5.0}))
        assert (result.outcome, result.crashed) == ("time-limit", []), result.reason


def test_an_interrupt_that_a_controller_raises_is_named_with_its_line(nothing_left: None) -> None:
    result = run(scenario(robots={"controller": "ends:Interrupts"}))
    assert re.fullmatch(r"node 1 crashed at tick 3: KeyboardInterrupt: .*\(ends\.py:\d+, in step\)", result.reason)


@pytest.mark.parametrize("error", ["SystemExit", "KeyboardInterrupt"])
def test_a_constructor_that_ends_its_process_is_named(error: str) -> None:
    chosen = ("robots.controller=ends:NotMade", f"robots.parameters.error={error}")
    ran = zwerm("run", "computation-free", *(f"--set={each}" for each in chosen), cwd=ROBOTS)
    assert ran.returncode == 2
    assert re.search(rf"^zwerm: ends:NotMade: .*raised {error}", ran.stderr, re.MULTILINE), ran.stderr
    assert "zwerm: node 1 ended with exit code 2 before it joined" in ran.stderr


def test_a_constructor_that_exits_is_an_error_of_an_inline_run() -> None:
    with pytest.raises(ZwermError, match=r"^ends:NotMade: its constructor raised SystemExit: .*ends\.py:\d+\)$"):
        run(scenario(robots={"controller": "ends:NotMade"}), runner="inline")


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
