"""The conformance kit: it finds nothing in good controllers, and in bad ones what is bad about them and nothing else."""

import builtins
import datetime
import doctest
import os
import random
import re
import secrets
import socket
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path
from time import monotonic
from typing import Any, ClassVar

import msgspec
import numpy as np
import pytest
from support import ROOT

from zwerm.agents.conformance.check import ConformanceError, check
from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.agents.runtime.controllers import find
from zwerm.catalogue import ROBOT, names
from zwerm.errors import ControllerError
from zwerm.maths.keyed_random import stream
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission, Wake, WheelSpeeds


def violations(controller: Any, *arguments: Any, **options: Any) -> list[str]:
    try:
        check(controller, *arguments, **options)
    except ConformanceError as error:
        return error.violations
    return []


def stepping(step: Callable[[Any, Observation], Any], **attributes: Any) -> type[Controller]:
    """Return a controller of which everything is good but `step`."""
    return type("Bad", (Controller,), {"step": step, **attributes})


def still(self: Any, observation: Observation) -> Command:
    return Command(drive=WheelSpeeds())


# --- the good -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", names(ROBOT))
def test_a_built_in_controller_conforms(name: str) -> None:
    check(find(name), channels=("robots", "uplink"))


class Wanderer:
    """No relative of `Controller`; uses randomness of its own stream, memory, sleep, the radio, holonomic drive."""

    sensors: ClassVar[tuple[str, ...]] = ("neighbours", "compass", "boundary")

    class Parameters(msgspec.Struct):
        speed_m_s: float

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._speed_m_s = msgspec.convert(setup.parameters, self.Parameters).speed_m_s
        self._random = stream(setup.stream_key)
        self._own = np.random.default_rng(7)
        self._heard: list[bytes] = []

    def step(self, observation: Observation) -> Command:
        assert observation.neighbours is not None
        assert observation.compass_rad is not None
        assert observation.boundary
        if "pose" in self._setup.sensors:
            raise AssertionError(observation.pose)
        self._heard += [packet.payload[:3] for packet in observation.inbox]
        outbox = tuple(Transmission(channel, b"here") for channel in self._setup.channels)
        drive = BodyVelocity(self._speed_m_s * self._random.random(), self._own.random(), observation.compass_rad)
        return Command(drive=drive, outbox=outbox, wake=Wake(at_s=observation.time_s + 1.0, on_packet=True))


def test_a_controller_of_somebody_elses_conforms() -> None:
    check(Wanderer, {"speed_m_s": 0.2})
    check(Wanderer, {"speed_m_s": 0.2}, channels=())


def test_a_lazy_import_is_no_input_or_output() -> None:
    def step(self: Any, observation: Observation) -> Command:
        if observation.tick == 1:
            sys.modules.pop("colorsys", None)
        import colorsys

        return Command(drive=WheelSpeeds(colorsys.ONE_THIRD, 0.0))

    check(stepping(step))


def test_a_sensor_of_ones_own_is_read_from_extra() -> None:
    def step(self: Any, observation: Observation) -> Command:
        assert observation.extra is not None
        return Command(drive=WheelSpeeds(observation.extra["light"][0], 0.0))

    check(stepping(step, sensors=("my_sensors:Light",)), extra={"light": (0.5,)})
    (found,) = violations(stepping(step, sensors=("my_sensors:Light",)))
    assert found.startswith("sensors: 'my_sensors:Light' is none that Zwerm knows")


def documented() -> dict[str, str]:
    """Return the text of every controller in the documentation and the README, by file name."""
    guide = (ROOT / "docs" / "controllers.md").read_text(encoding="utf-8")
    found = dict(re.findall(r'^```python title="(\w+)\.py"\n(.*?)^```$', guide, re.M | re.S))
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    return found | {"my_file": re.findall(r"^```python\n(from zwerm.agents.*?)^```$", readme, re.M | re.S)[0]}


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[type[Any]]]:
    """Every controller of the documentation, in files that can be imported."""
    monkeypatch.syspath_prepend(str(tmp_path))
    for name, text in documented().items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    yield [find(f"{name}:{'MyController' if name == 'my_file' else name.capitalize()}") for name in documented()]
    for name in documented():
        sys.modules.pop(name, None)


def test_every_controller_of_the_documentation_conforms(shelf: list[type[Any]]) -> None:
    assert {each.__name__ for each in shelf} >= {"Shy", "MyController"}
    for controller in shelf:
        check(controller)


def test_the_guides_example_of_the_kit_says_what_the_kit_says(shelf: list[type[Any]]) -> None:
    guide = (ROOT / "docs" / "controllers.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^```pycon\n(.*?)^```$", guide, re.M | re.S)
    example = doctest.DocTestParser().get_doctest(text, {}, "the guide", None, None)
    assert doctest.DocTestRunner().run(example) == (0, 5)


# --- the bad: what it is --------------------------------------------------------------------------------------------


def test_all_violations_are_told_at_once_with_the_controllers_name() -> None:
    def step(self: Any, observation: Observation) -> Command:
        time.time()
        print("hello")  # noqa: T201
        return Command(drive=WheelSpeeds(random.random(), 0.0))

    with pytest.raises(ConformanceError) as raised:
        check(stepping(step))
    kinds = [violation.split(":")[0] for violation in raised.value.violations]
    assert kinds == [
        "two controllers with the same Setup answer the same observations differently",
        "reads the wall clock",
        "draws from a global random stream",
        "prints",
    ]
    assert str(raised.value).splitlines()[0] == "Bad breaks the contract of a controller:"
    assert len(str(raised.value).splitlines()) == 5


def test_what_is_no_controller_class_is_refused() -> None:
    assert violations(still) == [f"expected a class, got {still!r}"]
    assert violations(type("Empty", (), {})) == ["it has no method step(observation)"]
    assert violations(stepping(still, sensors="touch")) == ["sensors: expected a tuple of names, got 'touch'"]
    assert violations(stepping(still, Parameters=dict)) == ["Parameters: expected a msgspec.Struct, got <class 'dict'>"]
    assert violations(stepping(still, sensors=("touch",)), sensors=["pose"]) == [
        "sensors: it declares 'touch', which check() was told not to give"
    ]


def test_a_constructor_takes_one_setup_and_its_parameters() -> None:
    class Two(Controller):
        def __init__(self, setup: Setup, speed: float) -> None:
            super().__init__(setup)

        step = still

    (found,) = violations(Two)
    assert found.startswith("the constructor raised TypeError: ")
    assert violations(Wanderer) == ["the constructor refuses its Setup: Object missing required field `speed_m_s`"]

    class NoBody(Controller):
        def __init__(self, setup: Setup) -> None:
            raise ControllerError("needs wings")

        step = still

    assert violations(NoBody) == ["the constructor refuses its Setup: needs wings"]


def test_a_setup_stays_as_it_was() -> None:
    class Keeps(Controller):
        def __init__(self, setup: Setup) -> None:
            setup.parameters["mine"] = 1

        step = still

    assert violations(Keeps) == ["the constructor changes its Setup"]


# --- the bad: what it answers ---------------------------------------------------------------------------------------


def raises_on(condition: Callable[[Observation], object]) -> type[Controller]:
    def step(self: Any, observation: Observation) -> Command:
        if condition(observation):
            raise ValueError("odd")
        return Command(drive=WheelSpeeds())

    return stepping(step, sensors=("neighbours", "touch"))


@pytest.mark.parametrize(
    ("condition", "title"),
    [
        (lambda o: o.neighbours == (), "nothing to be seen"),
        (lambda o: len(o.neighbours or ()) > 50, "everything to be seen"),
        (lambda o: o.touch and o.touch[0].half_width_rad > 3.0, "the ends of every range"),
        (lambda o: any(packet.sender is None for packet in o.inbox), "a packet of nobody"),
        (lambda o: any(packet.payload == b"" for packet in o.inbox), "an empty packet"),
        (lambda o: len(o.inbox) > 50, "many packets"),
        (lambda o: o.tick > 2**31 - 1, "tick 2147483648"),
    ],
)
def test_an_odd_observation_that_it_does_not_stand_is_named(
    condition: Callable[[Observation], object], title: str
) -> None:
    found = violations(raises_on(condition))
    place = f"{__file__}:{raises_on.__code__.co_firstlineno + 3}"
    assert f"step() raised ValueError: odd at {place}, on {title} as its first observation" in found
    assert all(violation.startswith("step() raised ValueError: odd") for violation in found)


@pytest.mark.parametrize(
    ("answer", "violation"),
    [
        (None, "step() returned None, expected a Command"),
        (WheelSpeeds(), "step() returned WheelSpeeds(left_m_s=0.0, right_m_s=0.0), expected a Command"),
        (Command(drive=WheelSpeeds(float("nan"), 0.0)), "step() returned what the world refuses: not-finite"),
        (Command(drive=WheelSpeeds(float("inf"), 0.0)), "step() returned what the world refuses: not-finite"),
        (Command(wake=Wake(at_s=float("nan"))), "step() returned what the world refuses: not-finite"),
        (Command(drive=WheelSpeeds("fast", 0.0)), "step() returned what the world refuses: schema"),  # type: ignore[arg-type]
        (Command(drive=WheelSpeeds(np.float32(0.1), 0.0)), "step() returned what cannot be encoded"),
        (Command(outbox=(Transmission("robots", object()),)), "step() returned what cannot be encoded"),  # type: ignore[arg-type]
        (Command(outbox=(Transmission("robots", bytes(70_000)),)), "step() returned what the world refuses: oversized"),
        (Command(outbox=(Transmission("gossip", b""),)), "step() sends on channel 'gossip'; its Setup names robots"),
        (Command(outbox=(Transmission("robots", b"", -1),)), "step() sends to node -1"),
    ],
)
def test_an_answer_that_the_world_would_refuse_is_told(answer: Any, violation: str) -> None:
    found = violations(stepping(lambda self, observation: answer))
    assert found
    assert all(each.startswith(violation) for each in found), found


def test_a_drive_that_fits_no_body_is_told() -> None:
    def step(self: Any, observation: Observation) -> Command:
        return Command(drive=WheelSpeeds() if observation.tick % 2 else BodyVelocity())

    assert all(" body with " in found for found in violations(stepping(step)))
    assert violations(stepping(step))


def test_sending_without_a_radio_is_told() -> None:
    sends = stepping(lambda self, observation: Command(outbox=(Transmission("robots", b""),)))
    check(sends)
    assert all("its Setup names none" in found for found in violations(sends, channels=()))
    assert violations(sends, channels=())


# --- the bad: what it does ------------------------------------------------------------------------------------------


def doing(action: Callable[[], object]) -> type[Controller]:
    """Return a controller whose answers are good whatever `action` gives."""

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
def test_what_a_controller_must_not_do_is_told_with_its_line(action: Callable[[], object], violation: str) -> None:
    here = f", at {__file__}:{action.__code__.co_firstlineno}"
    assert any(each.startswith(violation) and each.endswith(here) for each in violations(doing(action)))


def test_the_global_stream_of_numpy_is_told_and_left_as_it_was() -> None:
    before = np.random.get_state()[1].tolist()  # type: ignore[index, union-attr]  # noqa: NPY002
    assert violations(doing(lambda: np.random.rand())) == ["draws from a global random stream: numpy.random"]  # noqa: NPY002
    assert np.random.get_state()[1].tolist() == before  # type: ignore[index, union-attr]  # noqa: NPY002


def test_printing_is_told() -> None:
    assert violations(doing(lambda: print("where am I"))) == ["prints: 'where am I'"]  # noqa: T201
    assert violations(doing(lambda: sys.stderr.write("help\n"))) == ["prints: 'help'"]


def test_what_a_constructor_must_not_do_is_told() -> None:
    class Late(Controller):
        def __init__(self, setup: Setup) -> None:
            super().__init__(setup)
            self.born = time.time()

        step = still

    (found,) = violations(Late)
    assert found.startswith("reads the wall clock: time.time(), at ")


def test_the_traps_are_gone_afterwards(capsys: pytest.CaptureFixture[str]) -> None:
    profiler = sys.getprofile()
    check(doing(lambda: None))
    assert sys.getprofile() is profiler
    sys.stdout.write(f"{time.time() > 0}")
    assert capsys.readouterr().out == "True"


# --- the bad: what it depends on ------------------------------------------------------------------------------------

DIFFERENT = "two controllers with the same Setup answer the same observations differently"


def test_chance_that_is_not_its_own_stream_is_told() -> None:
    class Unseeded(Controller):
        def __init__(self, setup: Setup) -> None:
            self.random = np.random.default_rng()

        def step(self, observation: Observation) -> Command:
            return Command(drive=WheelSpeeds(self.random.random(), 0.0))

    (found,) = violations(Unseeded)
    assert found.startswith(DIFFERENT)
    assert found.endswith("(first at observation 0, nothing to be seen)")


def test_state_that_outlives_a_controller_is_told() -> None:
    class Counts(Controller):
        steps = 0

        def step(self, observation: Observation) -> Command:
            Counts.steps += 1
            return Command(drive=WheelSpeeds(0.001 * Counts.steps, 0.0))

    (found,) = violations(Counts)
    assert found.startswith(DIFFERENT)


def test_state_that_is_shared_with_its_neighbours_is_told() -> None:
    class Blackboard(Controller):
        board: ClassVar[dict[int, int]] = {}

        def __init__(self, setup: Setup) -> None:
            super().__init__(setup)
            self.board.clear()

        def step(self, observation: Observation) -> Command:
            self.board[self.setup.node] = observation.tick
            return Command(drive=WheelSpeeds(0.01 * len(self.board), 0.0))

    (found,) = violations(Blackboard)
    assert found.startswith("its answers change when another controller lives beside it: shared state")


@pytest.mark.parametrize("name", ["OrderOfASet", "HashOfAName"])
def test_an_answer_that_depends_on_the_hash_seed_is_told(name: str) -> None:
    (found,) = violations(find(f"bad_controllers:{name}"))
    assert found.startswith("its answers differ in another process with another PYTHONHASHSEED")


def test_a_sorted_set_is_no_violation() -> None:
    check(find("bad_controllers:OrderOfASortedSet"))


def test_an_observation_stays_as_it_was() -> None:
    def step(self: Any, observation: Observation) -> Command:
        msgspec.structs.force_setattr(observation, "time_s", 0.5)
        return Command(drive=WheelSpeeds())

    found = violations(stepping(step))
    assert found
    assert all(each.startswith("step() changes the observation") for each in found)


@pytest.mark.parametrize("field", ["line_of_sight", "pose", "compass_rad"])
def test_reading_a_sensor_that_is_not_declared_is_told(field: str) -> None:
    def step(self: Any, observation: Observation) -> Command:
        return Command(drive=WheelSpeeds(0.1 if getattr(observation, field) else 0.0, 0.0))

    assert violations(stepping(step)) == [f"step() reads observation.{field}, which it does not declare in `sensors`"]
    kind = field.removesuffix("_rad")
    check(stepping(step, sensors=(kind,)))
    check(stepping(step), sensors=[kind])


def test_a_sensor_that_is_not_declared_and_breaks_it_is_told_as_well() -> None:
    def step(self: Any, observation: Observation) -> Command:
        return Command(drive=WheelSpeeds(len(observation.touch), 0.0))  # type: ignore[arg-type]

    found = violations(stepping(step))
    assert any(each.startswith("step() raised TypeError: object of type 'NoneType' has no len()") for each in found)
    assert "step() reads observation.touch, which it does not declare in `sensors`" in found
