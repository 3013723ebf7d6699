"""The files of a new project, by name: robots that agree on the average of their values."""

from typing import Final

CONTROLLER: Final = '''"""A controller: every robot moves its value towards the values that it receives."""

import struct
from typing import Annotated

from msgspec import Meta, Struct

from zwerm import Command, Controller, Observation, Setup, Transmission


class Parameters(Struct, frozen=True, forbid_unknown_fields=True):
    """`gain` is the size of a step, in (0, 1]. A scenario sets it in [robots.parameters]."""

    gain: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.5


class MyRobot(Controller):
    """Broadcast the own value, and move it towards the mean of all values that are received."""

    Parameters = Parameters

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.value = float(setup.node)  # what this robot has measured

    def step(self, observation: Observation) -> Command:
        # The radio may damage a packet: take only what can be a value.
        received = [
            value
            for packet in observation.inbox
            if len(packet.payload) == 8 and abs(value := struct.unpack("<d", packet.payload)[0]) < 1e6
        ]
        if received:
            self.value += self.parameters.gain * (sum(received) / len(received) - self.value)
        packet = Transmission("robots", struct.pack("<d", self.value))
        return Command(outbox=(packet,), telemetry={"value": self.value})
'''

METRIC: Final = '''"""A metric: a function of the truth, to which no robot has access."""

from zwerm import Truth


def spread(truth: Truth) -> float:
    """Return the greatest difference between two robots' newest values; nan before the first ones."""
    values = [numbers["value"] for numbers in truth.telemetry.newest.values()]
    return max(values) - min(values) if values else float("nan")
'''

SCENARIO: Final = """summary = "Nine robots agree on a value over a short-range radio"

[time]
dt_s = 0.1
duration_s = 6.0

[arena]
size_m = [2.0, 2.0]

[robots]
count = 9
controller = "my_robot:MyRobot"

[robots.parameters]
gain = 0.5

[robots.body]
kind = "differential"

[radio]
range_m = 1.2
loss = 0.1

[metrics]
own = ["my_metric:spread"]
"""

STUDY: Final = """name = "loss"
summary = "The spread of the robots' values by the fraction of lost messages"
scenario = "scenario.toml"
seeds = 4
metrics = ["spread", "messages_per_robot_mean"]
picture = "line"

[grid]
"radio.loss" = [0.0, 0.3, 0.6]
"""

TEST: Final = '''"""Tests of the project: `python -m pytest`, or `python test_my_robot.py` without pytest."""

from pathlib import Path

from my_robot import MyRobot

import zwerm

SCENARIO = Path(__file__).with_name("scenario.toml")


def test_the_controller_keeps_its_contract() -> None:
    zwerm.check_controller(MyRobot)


def test_the_robots_agree() -> None:
    result = zwerm.run(SCENARIO, seed=1, runner="inline")
    assert result.ok
    assert result.metrics["spread"] < 0.1


def test_a_run_is_the_same_for_the_same_seed_only() -> None:
    traces = [zwerm.run(SCENARIO, seed, "inline").trace for seed in (1, 1, 2)]
    assert traces[0] == traces[1] != traces[2]


if __name__ == "__main__":
    test_the_controller_keeps_its_contract()
    test_the_robots_agree()
    test_a_run_is_the_same_for_the_same_seed_only()
    print("3 tests passed")
'''

README: Final = """# A swarm of my own

| file | contents |
| --- | --- |
| `my_robot.py` | the controller: what runs on every robot |
| `scenario.toml` | the experiment: arena, robots, radio |
| `my_metric.py` | a metric of the truth |
| `study.toml` | the scenario at several rates of loss, with several seeds |
| `test_my_robot.py` | tests |

Run these commands in this folder:

    zwerm check scenario.toml                                 # every mistake in one line each
    zwerm run scenario.toml --inline                          # in one process: fast
    zwerm run scenario.toml                                   # every robot a process of its own, the same trace
    zwerm run scenario.toml --inline --set radio.loss=0.5     # another setting
    zwerm study study.toml                                    # a table and a picture in runs/
    python -m pytest                                          # or: python test_my_robot.py

Put `breakpoint()` into `step` and run with `--inline` to debug.
"""

FILES: Final = {
    "README.md": README,
    "my_robot.py": CONTROLLER,
    "scenario.toml": SCENARIO,
    "my_metric.py": METRIC,
    "study.toml": STUDY,
    "test_my_robot.py": TEST,
}
