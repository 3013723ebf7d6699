"""Parameters of robots, base and coordinator are checked before a run: the exact line for every kind of mistake."""

import pytest

from zwerm.catalogue import COORDINATOR, names
from zwerm.errors import ScenarioError
from zwerm.run.assembly import prepare
from zwerm.scenario.load import load


@pytest.mark.parametrize(
    ("assignment", "start", "end"),
    [
        (
            "robots.parameters.link=2",
            "robots.parameters.link: unknown key; did you mean link_m?; known are link_m, ",
            "drive_ticks_max, walls",
        ),
        (
            "base.parameters.link=2",
            "base.parameters.link: unknown key; did you mean link_m?; known are link_m, ",
            "drive_ticks_max, walls",
        ),
        (
            "coordinator.parameters.link=2",
            "coordinator.parameters.link: unknown key; did you mean link_m?; known are link_m, ",
            "watch_until_s",
        ),
        ("robots.parameters.samples=0", "robots.parameters.samples: expected >= 1, got 0", ""),
        ("base.parameters.samples=1.5", "base.parameters.samples: expected an integer, got 1.5", ""),
        ("coordinator.parameters.link_m=far", 'coordinator.parameters.link_m: expected a number, got "far"', ""),
        ("coordinator.parameters.link_m=nan", "coordinator.parameters.link_m: expected > 0.0, got NaN", ""),
        ("coordinator.parameters.margin_m=2", "coordinator.parameters: expected margin_m < link_m, got ", "2}"),
        (
            "base.controller=beacons",
            "base.controller: expected a built-in controller (",
            "got 'beacons'; did you mean beacon?",
        ),
        (
            "coordinator.controller=beacon",
            f"coordinator.controller: expected a built-in coordinator ({', '.join(names(COORDINATOR))}) or module:Class, ",
            "got 'beacon'",
        ),
        ("coordinator.controller=nobody:Nobody", "coordinator.controller: cannot import 'nobody': ", "'nobody'"),
    ],
)
def test_a_wrong_parameter_is_one_line_with_its_place_the_rule_and_the_value(
    assignment: str, start: str, end: str
) -> None:
    scenario = load("sensor-coverage", (assignment,))
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario)
    (line,) = caught.value.mistakes
    place = f"--set {assignment}" if start.startswith(assignment.partition("=")[0]) else scenario.place
    assert line.startswith(f"{place}: {start}")
    assert line.endswith(end)


def test_every_wrong_parameter_of_every_node_is_reported_at_once_and_a_missing_sensor_once() -> None:
    wrong = ("robots.parameters.samples=0", "base.parameters.creep_m=0", "coordinator.parameters.nix=1")
    with pytest.raises(ScenarioError) as caught:
        prepare(load("sensor-coverage", (*wrong, "robots.sensors.2={kind='compass'}")))
    mistakes_text = "\n".join(caught.value.mistakes)
    assert len(caught.value.mistakes) == 4
    assert all(each.partition("=")[0] in mistakes_text for each in wrong)
    assert mistakes_text.count("needs the sensor 'odometry'") == 1
