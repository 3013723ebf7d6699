"""The conformance kit accepts correct controllers, and reports wrong declarations and wrong answers."""

import doctest
import random
import re
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np
import pytest
from contract_breaches import stepping, still, violations
from support import ROOT

from zwerm.agents.conformance.check import ConformanceError, check
from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.agents.runtime.controllers import find
from zwerm.catalogue import ROBOT, names
from zwerm.errors import ControllerError
from zwerm.maths.keyed_random import stream
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission, Wake, WheelSpeeds

# Parameters that a controller needs, or that fit the small bodies of the kit.
PARAMETERS: dict[str, dict[str, Any]] = {
    "leader-lease": {"swarm": 3},
    "landmark-navigator": {"map_file": '{"format": "landmark-map/1", "observations": [[[0, 1, 2], [0, 60, 120]]]}'},
    "robot-teams": {"footprint_m": 0.4, "spacing_m": 0.5},
}


@pytest.mark.parametrize("name", names(ROBOT))
def test_a_built_in_controller_conforms(name: str) -> None:
    check(find(name), PARAMETERS.get(name), channels=("robots", "uplink"))


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


def test_a_controller_without_the_base_class_conforms() -> None:
    check(Wanderer, {"speed_m_s": 0.2})
    check(Wanderer, {"speed_m_s": 0.2}, channels=())


def test_an_import_inside_step_is_no_violation() -> None:
    def step(self: Any, observation: Observation) -> Command:
        if observation.tick == 1:
            sys.modules.pop("colorsys", None)
        import colorsys

        return Command(drive=WheelSpeeds(colorsys.ONE_THIRD, 0.0))

    check(stepping(step))


def test_a_user_sensor_is_read_from_extra() -> None:
    def step(self: Any, observation: Observation) -> Command:
        assert observation.extra is not None
        return Command(drive=WheelSpeeds(observation.extra["light"][0], 0.0))

    check(stepping(step, sensors=("my_sensors:Light",)), extra={"light": (0.5,)})
    (found,) = violations(stepping(step, sensors=("my_sensors:Light",)))
    assert found.startswith("sensors: 'my_sensors:Light' is none that Zwerm knows")


def documented() -> dict[str, str]:
    """Return the text of every controller in the documentation and the README, by file name."""
    guide = (ROOT / "docs" / "how-to" / "controllers.md").read_text(encoding="utf-8")
    titled = re.findall(r'^```python title="(\w+)\.py"\n(.*?)^```$', guide, re.M | re.S)
    found = {name: text for name, text in titled if "(Controller)" in text}
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    return found | {"my_file": re.findall(r"^```python\n(from zwerm import.*?)^```$", readme, re.M | re.S)[0]}


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


def test_the_guides_example_shows_the_kits_real_output(shelf: list[type[Any]]) -> None:
    guide = (ROOT / "docs" / "how-to" / "controllers.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^```pycon\n(.*?)^```$", guide, re.M | re.S)
    example = doctest.DocTestParser().get_doctest(text, {}, "the guide", None, None)
    assert doctest.DocTestRunner().run(example) == (0, 5)


# --- the bad: what it is --------------------------------------------------------------------------------------------


def test_all_violations_are_reported_at_once_with_the_controllers_name() -> None:
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


def test_an_object_that_is_no_controller_class_is_refused() -> None:
    assert violations(still) == [f"expected a class, got {still!r}"]
    assert violations(type("Empty", (), {})) == ["it has no method step(observation)"]
    assert violations(stepping(still, sensors="touch")) == ["sensors: expected a tuple of names, got 'touch'"]
    assert violations(stepping(still, Parameters=dict)) == ["Parameters: expected a msgspec.Struct, got <class 'dict'>"]
    assert violations(stepping(still, sensors=("touch",)), sensors=["pose"]) == [
        "sensors: it declares 'touch', which check() does not give"
    ]


def test_a_constructor_that_refuses_its_setup_is_a_violation() -> None:
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


def test_a_constructor_that_changes_its_setup_is_a_violation() -> None:
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
        (lambda o: any(packet.sender is None for packet in o.inbox), "a packet without a sender"),
        (lambda o: any(packet.payload == b"" for packet in o.inbox), "an empty packet"),
        (lambda o: len(o.inbox) > 50, "many packets"),
        (lambda o: o.tick > 2**31 - 1, "tick 2147483648"),
    ],
)
def test_the_observation_that_makes_step_raise_is_named(condition: Callable[[Observation], object], title: str) -> None:
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
        (Command(drive=WheelSpeeds({1}, 0.0)), "step() returned what the world refuses: schema"),  # type: ignore[arg-type]
        (Command(outbox=(Transmission("robots", object()),)), "step() returned what cannot be encoded"),  # type: ignore[arg-type]
        (Command(outbox=(Transmission("robots", bytes(70_000)),)), "step() returned what the world refuses: oversized"),
        (Command(outbox=(Transmission("gossip", b""),)), "step() sends on channel 'gossip'; its Setup names robots"),
        (Command(outbox=(Transmission("robots", b"", -1),)), "step() sends to node -1"),
    ],
)
def test_an_answer_that_the_world_refuses_is_a_violation(answer: Any, violation: str) -> None:
    found = violations(stepping(lambda self, observation: answer))
    assert found
    assert all(each.startswith(violation) for each in found), found


def test_a_drive_command_that_fits_no_body_is_a_violation() -> None:
    def step(self: Any, observation: Observation) -> Command:
        return Command(drive=WheelSpeeds() if observation.tick % 2 else BodyVelocity())

    assert all(" body with " in found for found in violations(stepping(step)))
    assert violations(stepping(step))


def test_sending_without_a_radio_is_a_violation() -> None:
    sends = stepping(lambda self, observation: Command(outbox=(Transmission("robots", b""),)))
    check(sends)
    assert all("its Setup names none" in found for found in violations(sends, channels=()))
    assert violations(sends, channels=())
