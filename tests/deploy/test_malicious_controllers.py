"""A controller that attacks the run from inside its process is named and bounded, and the other robots go on."""

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import pytest
from support import scenario

from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.world.world import FLOOD as REFUSALS_MAX

# Those of the controllers in tests/robots/malicious.py.
ATTACKER, AT_TICK = 1, 3


pytestmark = pytest.mark.usefixtures("impatient")


def attacked(attack: str, faults: Sequence[Mapping[str, Any]] = (), **time: float) -> RunResult:
    robots = {"controller": f"malicious:{attack}", "count": 3, "on_crash": "continue"}
    return run(scenario(robots=robots, radio={"range_m": 1.0}, time={"duration_s": 1.0} | time, faults=list(faults)))


@pytest.mark.parametrize(
    ("attack", "reason"),
    [
        ("Junk", "its command was refused: schema"),
        ("Large", "its command was refused: oversized"),
        ("Crowded", "ValueError: the command takes "),
        ("NoNumber", "its command was refused: not-finite"),
        ("Exits", "its process ended with exit code 0"),
        ("Closes", ""),  # the connection ends, or the process does: the kernel decides
        ("Disconnects", ""),
    ],
)
def test_an_attack_ends_its_own_robot_and_no_other(
    nothing_left: None, monkeypatch: pytest.MonkeyPatch, attack: str, reason: str
) -> None:
    if not reason:  # the process may not end, so do not wait long for its exit code
        monkeypatch.setattr("zwerm.world.drivers.lockstep.EXIT_CODE_S", 0.1)
    result = attacked(attack)
    assert (result.outcome, result.ticks) == ("time-limit", 10), result.reason
    assert result.crashed == [ATTACKER]
    assert result.crash_reasons[ATTACKER].startswith(f"tick {AT_TICK}: {reason}")
    assert result.middleware_lost == 0


def test_a_robot_that_writes_to_every_descriptor_keeps_no_other_from_a_restart(
    nothing_left: None, capfd: pytest.CaptureFixture[str]
) -> None:
    result = attacked("Scribbles", faults=[{"kind": "restart", "nodes": [2], "at_s": 0.6}])
    assert (result.outcome, result.ticks) == ("time-limit", 10), result.reason
    assert (list(result.crash_reasons), result.restarted) == ([ATTACKER], [2])
    assert "Traceback" not in capfd.readouterr().err, "a process of the run has failed"


def test_a_flood_of_answers_is_counted_and_its_robot_evicted(nothing_left: None) -> None:
    result = attacked("Twice", duration_s=20.0)
    assert (result.outcome, result.ticks) == ("time-limit", 200), result.reason
    assert result.crashed == [ATTACKER]
    assert f"flood: {REFUSALS_MAX} of its messages were refused" in result.crash_reasons[ATTACKER]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a socket does not tell who has connected")
def test_a_robot_that_opens_another_session_is_cut_off_and_no_other(nothing_left: None) -> None:
    result = attacked("OpensAnotherSession", duration_s=300.0)
    assert (result.outcome, result.ticks) == ("time-limit", 3_000), result.reason
    assert result.crashed == [ATTACKER]
    assert result.refused["cut-off"] >= 1


def test_a_controller_that_never_answers_and_ignores_signals_is_named_and_ended(nothing_left: None) -> None:
    result = attacked("Endless", straggler_s=1.0)
    assert (result.outcome, result.middleware_lost) == ("failed", 0)
    assert f"node {ATTACKER}" in result.reason
