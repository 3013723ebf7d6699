"""A command that the world refuses ends its node at once, with the node, the tick, the rule, the value and the place."""

import pytest
from support import scenario

from zwerm.run.runner import Runner, run
from zwerm.run.validation import own_controller_mistakes

REFUSED = {
    "WrongDrive": "its command was refused: wrong-drive: drive: a differential body takes WheelSpeeds, "
    "got BodyVelocity(forward_m_s=0.25, left_m_s=0.0, turn_rad_s=0.0) (refused.py:16, in WrongDrive.step)",
    "NotANumber": "its command was refused: not-finite: WheelSpeeds(left_m_s=nan, right_m_s=0.0) "
    "(refused.py:16, in NotANumber.step)",
    "TextForBytes": "its command was refused: schema: outbox[0].payload: expected bytes, got 'hello' "
    "(refused.py:16, in TextForBytes.step)",
    "NoRadio": "its command was refused: wrong-packet: outbox: no channel 'robots': the scenario has no [radio] "
    "(refused.py:16, in NoRadio.step)",
    "Nothing": "TypeError: step() returned None, expected a Command (refused.py:16, in Nothing.step)",
    "NoSuchType": "its command was refused: schema: drive.left_m_s: expected float, got [1] "
    "(refused.py:16, in NoSuchType.step)",
}


@pytest.mark.parametrize("runner", ["inline", "processes"])
@pytest.mark.parametrize(("name", "reason"), REFUSED.items(), ids=REFUSED)
def test_a_refused_command_is_a_crash_that_names_everything_at_once(
    runner: Runner, name: str, reason: str, nothing_left: None
) -> None:
    result = run(scenario(robots={"controller": f"refused:{name}"}, time={"straggler_s": 60.0}), runner=runner)
    assert result.outcome == "failed"
    assert result.reason == f"node 1 crashed at tick 3: {reason}"
    assert (result.crashed, result.middleware_lost) == ([1], 0)


@pytest.mark.parametrize("runner", ["inline", "processes"])
def test_a_run_that_continues_goes_on_without_the_refused_node(runner: Runner, nothing_left: None) -> None:
    result = run(scenario(robots={"controller": "refused:WrongDrive", "on_crash": "continue"}), runner=runner)
    assert (result.outcome, result.crashed, result.ticks) == ("time-limit", [1], 20)
    assert result.refused == {"wrong-drive": 1}
    assert result.as_json()["nodes"]["reasons"] == {"1": f"tick 3: {REFUSED['WrongDrive']}"}


def test_numpy_scalars_are_numbers_with_the_same_trace() -> None:
    numpy, plain = (
        run(scenario(robots={"controller": f"refused:{name}"}), runner="inline") for name in ("Numpy", "Plain")
    )
    assert numpy.outcome == "time-limit"
    assert numpy.trace == plain.trace


@pytest.mark.parametrize(
    ("name", "violation"),
    [
        ("refused:Sideways", "step() drives a differential body with BodyVelocity; it takes WheelSpeeds"),
        ("refused:Talks", "step() sends on channel 'robots'; its Setup names none"),
    ],
)
def test_checking_a_scenario_steps_its_own_controllers(name: str, violation: str) -> None:
    found = own_controller_mistakes(scenario(robots={"controller": name}))
    assert len(found) <= 3, "the rules that it breaks, not the observations"
    assert found[0].startswith(f"small.toml: robot: {name}: {violation}")
    assert own_controller_mistakes(scenario()) == [], "built-in controllers are not stepped"
