"""The conformance kit detects forbidden actions, hidden state and undeclared sensors."""

import builtins
import datetime
import os
import random
import secrets
import socket
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable
from datetime import date
from pathlib import Path
from time import monotonic
from typing import Any, ClassVar

import msgspec
import numpy as np
import pytest
from contract_breaches import stepping, still, violations

from zwerm.agents.conformance.check import check
from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.agents.runtime.controllers import find
from zwerm.wire.messages import Command, Observation, WheelSpeeds


def doing(action: Callable[[], object]) -> type[Controller]:
    """Return a controller that calls `action` in each step and returns a correct command."""

    def step(self: Any, observation: Observation) -> Command:
        if observation.tick == 1:
            action()
        return Command(drive=WheelSpeeds())

    return stepping(step)


@pytest.mark.parametrize(
    ("action", "violation"),
    [
        (lambda: time.time(), "reads the wall clock: time.time()"),
        (lambda: monotonic(), "reads the wall clock: time.monotonic()"),
        (lambda: time.perf_counter_ns(), "reads the wall clock: time.perf_counter_ns()"),
        (lambda: datetime.datetime.now(), "reads the wall clock: datetime.now()"),
        (lambda: date.today(), "reads the wall clock: date.today()"),
        (lambda: time.sleep(0), "sleeps: time.sleep()"),
        (lambda: random.random(), "draws from a global random stream: random"),
        (lambda: random.choice([1, 2]), "draws from a global random stream: random"),
        (lambda: random.seed(3), "draws from a global random stream: random"),
        (lambda: os.urandom(1), "draws from the operating system's entropy: os.urandom()"),
        (lambda: secrets.token_bytes(1), "draws from the operating system's entropy: os.urandom()"),
        (lambda: uuid.uuid4(), "draws from the operating system's entropy: os.urandom()"),
        (lambda: os.getpid(), "asks which process it is: os.getpid()"),
        (lambda: os.environ.get("HOME"), "reads the environment: os.environ"),
        (lambda: builtins.open(os.devnull).close(), f"opens a file: {os.devnull!r}"),  # noqa: PTH123
        (lambda: Path(os.devnull).read_bytes(), f"opens a file: {os.devnull!r}"),
        (lambda: os.listdir("/"), "touches the file system or the environment (os.listdir)"),  # noqa: PTH208
        (lambda: socket.socket().close(), "uses the network (socket.__new__)"),
        (lambda: threading.Thread(target=int).start(), "starts a thread: _thread.start_"),
        (lambda: subprocess.run(["true"], check=True), "starts a process (subprocess.Popen)"),
    ],
)
def test_a_forbidden_action_is_reported_with_its_line(action: Callable[[], object], violation: str) -> None:
    here = f", at {__file__}:{action.__code__.co_firstlineno}"
    assert any(each.startswith(violation) and each.endswith(here) for each in violations(doing(action)))


def test_use_of_numpys_global_stream_is_reported_and_undone() -> None:
    before = np.random.get_state()[1].tolist()  # type: ignore[index]  # noqa: NPY002
    assert violations(doing(lambda: np.random.rand())) == ["draws from a global random stream: numpy.random"]  # noqa: NPY002
    assert np.random.get_state()[1].tolist() == before  # type: ignore[index]  # noqa: NPY002


def test_printing_is_a_violation() -> None:
    assert violations(doing(lambda: print("where am I"))) == ["prints: 'where am I'"]  # noqa: T201
    assert violations(doing(lambda: sys.stderr.write("help\n"))) == ["prints: 'help'"]


def test_a_forbidden_action_in_the_constructor_is_reported() -> None:
    class Late(Controller):
        def __init__(self, setup: Setup) -> None:
            super().__init__(setup)
            self.born = time.time()

        step = still

    (found,) = violations(Late)
    assert found.startswith("reads the wall clock: time.time(), at ")


def test_the_purity_monitor_is_inactive_after_the_check(capsys: pytest.CaptureFixture[str]) -> None:
    profiler = sys.getprofile()
    check(doing(lambda: None))
    assert sys.getprofile() is profiler
    sys.stdout.write(f"{time.time() > 0}")
    assert capsys.readouterr().out == "True"


# --- the bad: what it depends on ------------------------------------------------------------------------------------

DIFFERENT = "two controllers with the same Setup answer the same observations differently"


def test_randomness_outside_the_setups_stream_is_a_violation() -> None:
    class Unseeded(Controller):
        def __init__(self, setup: Setup) -> None:
            self.random = np.random.default_rng()

        def step(self, observation: Observation) -> Command:
            return Command(drive=WheelSpeeds(self.random.random(), 0.0))

    (found,) = violations(Unseeded)
    assert found.startswith(DIFFERENT)
    assert found.endswith("(first at observation 0, nothing to be seen)")


def test_state_that_outlives_a_controller_is_a_violation() -> None:
    class Counts(Controller):
        steps = 0

        def step(self, observation: Observation) -> Command:
            Counts.steps += 1
            return Command(drive=WheelSpeeds(0.001 * Counts.steps, 0.0))

    (found,) = violations(Counts)
    assert found.startswith(DIFFERENT)


def test_state_shared_between_controllers_is_a_violation() -> None:
    class Blackboard(Controller):
        board: ClassVar[dict[int, int]] = {}

        def __init__(self, setup: Setup) -> None:
            super().__init__(setup)
            self.board.clear()

        def step(self, observation: Observation) -> Command:
            self.board[self.setup.node] = observation.tick
            return Command(drive=WheelSpeeds(0.01 * len(self.board), 0.0))

    (found,) = violations(Blackboard)
    assert found.startswith("its answers change when another controller runs in the same process: shared state")


@pytest.mark.parametrize("name", ["OrderOfASet", "HashOfAName"])
def test_an_answer_that_depends_on_the_hash_seed_is_a_violation(name: str) -> None:
    (found,) = violations(find(f"bad_controllers:{name}"))
    assert found.startswith("its answers differ in another process with another PYTHONHASHSEED")


def test_a_sorted_set_is_no_violation() -> None:
    check(find("bad_controllers:OrderOfASortedSet"))


def test_a_step_that_changes_its_observation_is_a_violation() -> None:
    def step(self: Any, observation: Observation) -> Command:
        msgspec.structs.force_setattr(observation, "time_s", 0.5)
        return Command(drive=WheelSpeeds())

    found = violations(stepping(step))
    assert found
    assert all(each.startswith("step() changes the observation") for each in found)


@pytest.mark.parametrize("field", ["line_of_sight", "pose", "compass_rad"])
def test_reading_an_undeclared_sensor_is_a_violation(field: str) -> None:
    def step(self: Any, observation: Observation) -> Command:
        return Command(drive=WheelSpeeds(0.1 if getattr(observation, field) else 0.0, 0.0))

    assert violations(stepping(step)) == [f"step() reads observation.{field}, which it does not declare in `sensors`"]
    kind = field.removesuffix("_rad")
    check(stepping(step, sensors=(kind,)))
    check(stepping(step), sensors=[kind])


def test_an_undeclared_sensor_is_reported_even_if_step_raises() -> None:
    def step(self: Any, observation: Observation) -> Command:
        return Command(drive=WheelSpeeds(len(observation.touch), 0.0))  # type: ignore[arg-type]

    found = violations(stepping(step))
    assert any(each.startswith("step() raised TypeError: object of type 'NoneType' has no len()") for each in found)
    assert "step() reads observation.touch, which it does not declare in `sensors`" in found
