"""The computation-free controllers and the random walk, against the paper's numbers and against scipy's distributions."""

import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats
from support import ROOT, ZWERM

from zwerm.agents.computation_free.random_walk import symmetric_stable, wrapped_cauchy
from zwerm.agents.computation_free.reactive import WheelTable
from zwerm.agents.runtime.contract import Body, Setup
from zwerm.agents.runtime.controllers import make
from zwerm.errors import ControllerError
from zwerm.maths.keyed_random import Draws
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.wire.messages import Command, Observation, WheelSpeeds

# The e-puck of the paper.
EPUCK = Body("differential", radius_m=0.037, max_speed_m_s=0.128, max_turn_rad_s=6.0, wheel_base_m=0.051)
DT_S = 0.1
KEY = Draws(1).stream_key("controller", 0)


def setup(parameters: dict[str, Any] | None = None, body: Body | None = EPUCK, key: bytes = KEY) -> Setup:
    return Setup(0, "robot", DT_S, ("line_of_sight",), key, body, (), parameters or {})


def wheels(command: Command) -> tuple[float, float]:
    assert isinstance(command.drive, WheelSpeeds)
    return command.drive.left_m_s, command.drive.right_m_s


def orbit(wheels: tuple[float, float]) -> tuple[float, float]:
    """Return (radius [m], angular velocity [rad/s]) of a differential drive. Dudek and Jenkin 2010."""
    left, right = wheels
    turn = (right - left) / EPUCK.wheel_base_m
    return abs((left + right) / 2.0 / turn), turn


# --- computation-free -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scenario", "alone", "sighted"),
    [
        ("computation-free", (0.719558, 0.412543), (-0.998071, -0.911843)),
        ("computation-free-open-loop", (-1.0, -1.0), (-1.0, -1.0)),
        ("computation-free-greedy", (1.0, -1.0), (-1.0, -1.0)),
    ],
)
def test_one_bit_selects_one_of_two_pairs_of_wheel_speeds(
    scenario: str, alone: tuple[float, float], sighted: tuple[float, float]
) -> None:
    robots = load(scenario).robots
    assert robots.body.max_speed_m_s == EPUCK.max_speed_m_s
    controller = make(robots.controller, setup(robots.parameters))
    for tick, bit in enumerate([False, True, True, False, True]):
        expected = sighted if bit else alone
        found = wheels(controller.step(Observation(tick, tick * DT_S, line_of_sight=bit)))
        assert found == pytest.approx((0.128 * expected[0], 0.128 * expected[1]), rel=1e-12)


def test_the_best_controller_runs_on_the_papers_two_circles() -> None:
    controller = make("computation-free", setup())
    alone = orbit(wheels(controller.step(Observation(0, 0.0, line_of_sight=False))))
    sighted = orbit(wheels(controller.step(Observation(1, 0.1, line_of_sight=True))))
    assert alone == (pytest.approx(0.0940, abs=5e-5), pytest.approx(-0.77, abs=5e-3))
    assert sighted == (pytest.approx(0.5648, abs=5e-5), pytest.approx(0.22, abs=5e-3))
    # "95.5 % of the maximum linear speed" backward when it sees, "56.6 %" forward when it does not.
    table = WheelTable()
    assert (table.left_1 + table.right_1) / 2.0 == pytest.approx(-0.955, abs=5e-4)
    assert (table.left_0 + table.right_0) / 2.0 == pytest.approx(0.566, abs=5e-4)


def test_a_wheel_speed_beyond_the_motor_is_refused() -> None:
    with pytest.raises(ControllerError, match=r"computation-free: Expected `float` <= 1\.0 - at `\$\.left_0`"):
        make("computation-free", setup({"left_0": 1.01}))
    with pytest.raises(ControllerError, match="needs a body with wheels"):
        make("computation-free", setup(body=None))


# --- a controller of the user's --------------------------------------------------------------------------------------


def test_the_guides_first_controller_runs_from_the_users_folder_by_the_guides_command(tmp_path: Path) -> None:
    guide = (ROOT / "docs" / "how-to" / "controllers.md").read_text(encoding="utf-8")
    (text,) = re.findall(r'^```python title="shy\.py"\n(.*?)^```$', guide, re.M | re.S)
    command = "zwerm run computation-free --set robots.controller=shy:Shy"
    assert f"\n$ {command}\n" in guide
    (tmp_path / "shy.py").write_text(text, encoding="utf-8")
    arguments = [*command.split()[1:], "--inline", "--json", "--set", "time.duration_s=5"]
    ran = subprocess.run(
        [sys.executable, *ZWERM, *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    printed = json.loads(ran.stdout)
    assert (printed["outcome"], printed["ticks"], printed["robot_ticks"]) == ("time-limit", 50, 50 * 25)
    other = run("computation-free", 1, "inline", ["time.duration_s=5"])
    assert printed["trace"] != other.trace


# --- random walk ----------------------------------------------------------------------------------------------------

# Kolmogorov and Smirnov's test on so many draws tells shapes apart that differ by 0.02, and accepts the right ones here.
DRAWS = 20_000
ACCEPT_P = 0.01


def drawn(draw: Callable[[np.random.Generator], float]) -> list[float]:
    random = Draws(20).generator("test")
    return [draw(random) for _ in range(DRAWS)]


@pytest.mark.parametrize("rho", [0.05, 0.41, 0.9])
def test_turning_angles_are_wrapped_cauchy(rho: float) -> None:
    angles = drawn(lambda random: wrapped_cauchy(random, rho))
    assert -math.pi <= min(angles)
    assert max(angles) <= math.pi
    # scipy's lives on [0, 2 pi), with the same mean 0.
    around = np.mod(angles, 2.0 * math.pi)
    assert stats.kstest(around, stats.wrapcauchy(rho).cdf).pvalue > ACCEPT_P
    assert stats.kstest(around, stats.wrapcauchy(rho + 0.08).cdf).pvalue < 1e-4
    assert np.mean(np.cos(angles)) == pytest.approx(rho, abs=0.015)


@pytest.mark.parametrize("alpha", [0.8, 1.0, 1.67, 2.0])
def test_lengths_are_symmetric_stable(alpha: float) -> None:
    scale = 0.156
    lengths = np.array(drawn(lambda random: symmetric_stable(random, alpha, scale)))
    # scipy integrates numerically: a table of its distribution between the quantiles of interest is as good.
    at = scale * np.concatenate([-np.geomspace(1e4, 1e-3, 60), [0.0], np.geomspace(1e-3, 1e4, 60)])
    table = {a: stats.levy_stable(a, 0.0, scale=scale).cdf(at) for a in (alpha, alpha - 0.3)}
    right, wrong = (stats.kstest(np.interp(lengths, at, table[a]), "uniform").pvalue for a in (alpha, alpha - 0.3))
    assert right > ACCEPT_P
    assert wrong < 1e-4


def test_the_gaussian_end_of_stable_has_twice_the_variance_of_its_scale() -> None:
    lengths = drawn(lambda random: symmetric_stable(random, 2.0, 0.5))
    assert np.var(lengths) == pytest.approx(2.0 * 0.5**2, rel=0.03)


def test_an_exact_zero_among_the_draws_gives_a_finite_length() -> None:
    class Zeros:
        def random(self) -> float:
            return 0.0

    for alpha in (0.5, 1.0, 1.67, 2.0):
        assert math.isfinite(symmetric_stable(Zeros(), alpha, 0.156))  # type: ignore[arg-type]


def walk(steps: int, key: bytes = KEY, **parameters: float) -> list[tuple[float, float]]:
    controller = make("random-walk", setup(dict(parameters), key=key))
    return [wheels(controller.step(Observation(tick, tick * DT_S))) for tick in range(steps)]


def test_a_walk_alternates_segments_and_turns_of_the_lengths_that_it_draws() -> None:
    """Replays the draws: first an angle, then a length; each lasts the nearest whole number of control cycles."""
    random = Draws(1).generator("controller", 0)
    speed, turn_rad = 0.128, 2.0 * 0.128 / 0.051 * DT_S
    expected: list[tuple[float, float]] = []
    while len(expected) < 2000:
        angle = wrapped_cauchy(random, 0.41)
        length = abs(symmetric_stable(random, 1.67, 0.156))
        side = 1 if angle >= 0.0 else -1
        expected += [(-side * speed, side * speed)] * round(abs(angle) / turn_rad)
        expected += [(speed, speed)] * round(length / (speed * DT_S))
    assert walk(2000) == expected[:2000]
    kinds = {kind for kind, _ in groupby(expected)}
    assert kinds == {(speed, speed), (speed, -speed), (-speed, speed)}


def test_a_random_walk_draws_from_the_stream_of_its_node_only() -> None:
    assert walk(300) == walk(300)
    assert walk(300) != walk(300, key=Draws(1).stream_key("controller", 1))
    assert walk(300) != walk(300, key=Draws(2).stream_key("controller", 0))


def test_a_straighter_walk_turns_less() -> None:
    def turning(rho: float) -> int:
        return sum(left != right for left, right in walk(5000, rho=rho))

    assert turning(0.99) < turning(0.41) < turning(0.01)


@pytest.mark.parametrize(
    ("parameters", "mistake"),
    [
        ({"rho": 1.0}, "Expected `float` < 1.0 - at `$.rho`"),
        ({"alpha": 0.0}, "Expected `float` > 0.0 - at `$.alpha`"),
        ({"alpha": 2.1}, "Expected `float` <= 2.0 - at `$.alpha`"),
        ({"beta": 0.2}, "Object contains unknown field `beta`"),
    ],
)
def test_invalid_parameters_of_a_walk_are_refused(parameters: dict[str, float], mistake: str) -> None:
    with pytest.raises(ControllerError) as raised:
        make("random-walk", setup(parameters))
    assert mistake in str(raised.value)
    with pytest.raises(ControllerError, match="needs a body with wheels"):
        make("random-walk", setup(body=Body("holonomic", 0.1, 0.5, 3.0)))
