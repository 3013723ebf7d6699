"""Does a controller keep the contract? One call tells, in anybody's tests: `check(MyController)`.

The controller is made and stepped as a runner would, through plain days and odd ones: nothing to be seen, everything to be
seen, packets that make no sense, the far future. It must answer each observation with a command that the world takes, the
same command for the same life whatever lives beside it, and it must not do what `traps` watches for. What is found is
listed all at once. No finding is no proof: the kit looks at a few hundred observations.
"""

import importlib
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from hashlib import blake2b
from typing import Any, Final

import msgspec

from zwerm.agents.conformance.purity import PurityMonitor
from zwerm.agents.conformance.stimuli import FIELD_OF, StimulusSetup, tell
from zwerm.agents.runtime.contract import Body, NoParameters, Setup
from zwerm.errors import ControllerError, ProtocolError, ZwermError
from zwerm.maths.keyed_random import Draws
from zwerm.wire.messages import (
    SENSOR_FIELDS,
    BodyVelocity,
    Command,
    Observation,
    WheelSpeeds,
    decode_observation,
    encode,
    open_answer,
)

_DRAWS: Final = Draws(2019)
_BODIES: Final = (
    Body("differential", radius_m=0.037, max_speed_m_s=0.128, max_turn_rad_s=6.0, wheel_base_m=0.051),
    Body("holonomic", radius_m=0.1, max_speed_m_s=0.5, max_turn_rad_s=3.0),
)
_DRIVE_OF: Final = {"differential": WheelSpeeds, "holonomic": BodyVelocity}
_DT_S: Final = 0.1
_HASH_SEEDS: Final = ("1", "2")
_CHILD_S: Final = 120.0
_NOT_IMPORTABLE: Final = 3


class ConformanceError(ZwermError):
    """A controller breaks the contract; `violations` lists how, a line each."""

    def __init__(self, name: str, violations: list[str]) -> None:
        super().__init__("\n  - ".join([f"{name} breaks the contract of a controller:", *violations]))
        self.violations = violations


def check(
    controller: type[Any],
    parameters: Mapping[str, Any] | None = None,
    sensors: Sequence[str] | None = None,
    *,
    channels: Sequence[str] = ("robots",),
    extra: Mapping[str, tuple[float, ...]] | None = None,
) -> None:
    """Raise ConformanceError with everything in which `controller` breaks the contract.

    `parameters` are what a scenario would set, `sensors` what it would give (by default what the controller declares),
    `channels` the radio's (none: `()`), `extra` a reading of each sensor of one's own. The controller has to work on one
    of two bodies, an e-puck's or a holonomic one.
    """
    name = getattr(controller, "__qualname__", repr(controller))
    found = _declarations(controller, sensors, extra)
    if not found:
        given = tuple(controller_sensors(controller) if sensors is None else sensors)
        setups = [_setup(given, body, tuple(channels), dict(parameters or {})) for body in _BODIES]
        examinations = [_Examination(controller, setup, extra) for setup in setups]
        fitting = min(examinations, key=lambda each: (not each.fits, len(each.violations)))
        fitting.live_elsewhere()
        found = fitting.violations
    if found:
        raise ConformanceError(name, found)


def controller_sensors(controller: type[Any]) -> tuple[str, ...]:
    """Return the sensors that a controller declares."""
    return tuple(getattr(controller, "sensors", ()))


def _declarations(
    controller: type[Any], sensors: Sequence[str] | None, extra: Mapping[str, tuple[float, ...]] | None
) -> list[str]:
    """Return what is wrong with a controller before it is made."""
    if not isinstance(controller, type):
        return [f"expected a class, got {controller!r}"]
    found = []
    if not callable(getattr(controller, "step", None)):
        found.append("it has no method step(observation)")
    declared = getattr(controller, "sensors", ())
    if not isinstance(declared, tuple | list) or not all(isinstance(each, str) for each in declared):
        return [*found, f"sensors: expected a tuple of names, got {declared!r}"]
    for sensor in declared:
        if FIELD_OF.get(sensor) is None and not extra:
            found.append(f"sensors: {sensor!r} is none that Zwerm knows; give a reading of your own with extra=")
        if sensors is not None and sensor not in sensors:
            found.append(f"sensors: it declares {sensor!r}, which check() was told not to give")
    kind = getattr(controller, "Parameters", NoParameters)
    if not (isinstance(kind, type) and issubclass(kind, msgspec.Struct)):
        found.append(f"Parameters: expected a msgspec.Struct, got {kind!r}")
    return found


def _setup(sensors: tuple[str, ...], body: Body, channels: tuple[str, ...], parameters: dict[str, Any]) -> Setup:
    key = _DRAWS.stream_key("conformance", 0)
    return Setup(0, "robot", _DT_S, sensors, key, body, channels, parameters)


class _Examination:
    """All checks of one controller on one body."""

    def __init__(self, controller: type[Any], setup: Setup, extra: Mapping[str, tuple[float, ...]] | None) -> None:
        self._controller = controller
        self._setup = setup
        self.violations: list[str] = []
        self.fits = True  # the controller takes this body, and drives it as it can be driven
        fields = [field for sensor in setup.sensors if (field := FIELD_OF.get(sensor)) is not None]
        self._given = {*fields, *(["extra"] if extra else [])}
        self._story = tell(StimulusSetup(tuple(fields), setup.channels, dict(extra or {}), setup.dt_s))
        with PurityMonitor() as watch:
            self._life: list[bytes | None] | None = None
            if self._make() is not None:
                self._each_alone()
                self._life = self._whole_lives()
                self._reading()
        self.violations += watch.found

    def _note(self, violation: str) -> None:
        if violation not in self.violations:
            self.violations.append(violation)

    def _make(self, node: int = 0) -> Any:
        """Return a new controller with a Setup of its own, or None with the violation noted."""
        key = self._setup.stream_key if node == 0 else _DRAWS.stream_key("conformance", node)
        sent = encode(msgspec.structs.replace(self._setup, node=node, stream_key=key))
        setup = msgspec.msgpack.decode(sent, type=Setup)
        try:
            made = self._controller(setup)
        except (msgspec.ValidationError, ControllerError) as error:
            self.fits = False
            self._note(f"the constructor refuses its Setup: {error}")
            return None
        except Exception as error:
            self._note(f"the constructor raised {_said(error)}")
            return None
        if encode(setup) != sent:
            self._note("the constructor changes its Setup")
        return made

    def _step(self, controller: Any, sent: bytes, when: str) -> bytes | None:
        """Return the encoded answer to one encoded observation, or None with the violations noted."""
        observation = decode_observation(sent)
        try:
            command = controller.step(observation)
        except Exception as error:
            self._note(f"step() raised {_said(error)}, on {when}")
            return None
        if encode(observation) != sent:
            self._note(f"step() changes the observation, on {when}")
        if not isinstance(command, Command):
            self._note(f"step() returned {_short(command)}, expected a Command, on {when}")
            return None
        command.tick = observation.tick
        return self._answer(command, when)

    def _answer(self, command: Command, when: str) -> bytes | None:
        """Return the command as it goes over the wire, or None with the reasons noted why the world would refuse it."""
        try:
            payload = encode(command)
            open_answer(payload)
        except (TypeError, ValueError, OverflowError, RecursionError) as error:
            self._note(f"step() returned what cannot be encoded: {error}, on {when}")
            return None
        except ProtocolError as error:
            self._note(f"step() returned what the world refuses: {error}, on {when}")
            return None
        body = self._setup.body
        if command.drive is not None and body is not None and type(command.drive) is not _DRIVE_OF[body.kind]:
            self.fits = False
            self._note(f"step() drives a {body.kind} body with {type(command.drive).__name__}, on {when}")
        for message in command.outbox:
            if message.channel not in self._setup.channels:
                known = ", ".join(self._setup.channels) or "none"
                self._note(f"step() sends on channel {message.channel!r}; its Setup names {known}, on {when}")
            if message.to is not None and message.to < 0:
                self._note(f"step() sends to node {message.to}, on {when}")
        return payload

    def _each_alone(self) -> None:
        """Show every kind of observation to a controller that has seen nothing yet."""
        first = {chapter.title: chapter for chapter in reversed(self._story)}
        for title in sorted(first):
            controller = self._make()
            if controller is not None:
                self._step(controller, first[title].sent, f"{title} as its first observation")

    def _live(self, controller: Any, beside: Any = None) -> list[bytes | None]:
        """Return a controller's answers to the whole story, while `beside` it another lives through the same."""
        answers = []
        for number, chapter in enumerate(self._story):
            when = f"observation {number} ({chapter.title})"
            if beside is not None:
                self._step(beside, chapter.sent, when)
            answers.append(self._step(controller, chapter.sent, when))
            if answers[-1] is None:
                break
        return answers

    def _whole_lives(self) -> list[bytes | None] | None:
        """Compare the lives of controllers that should be the same, and return one if all are."""
        one = self._live(self._make())
        if None in one:
            return None
        again = self._live(self._make())
        if number := _first_difference(one, again):
            self._note(
                "two controllers with the same Setup answer the same observations differently: state that instances share,"
                f" or chance that is not the stream of the Setup ({self._when(number)})"
            )
            return None
        other = self._make(node=1)
        if number := _first_difference(one, self._live(self._make(), beside=other)):
            self._note(
                f"its answers change when another controller lives beside it: shared state ({self._when(number)})"
            )
            return None
        return one

    def live_elsewhere(self) -> None:
        """Compare the life, if it went well, with those of new interpreters that hash strings differently."""
        if self._life is None:
            return
        story = [each.sent for each in self._story]
        for hash_seed in _HASH_SEEDS:
            digest = _life_elsewhere(self._controller, self._setup, story, hash_seed)
            if digest is not None and digest != _digest(self._life):
                self._note(
                    "its answers differ in another process with another PYTHONHASHSEED:"
                    " the order of a set, or hash(), decides something; sort it"
                )
                return

    def _when(self, number: int) -> str:
        return f"first at observation {number - 1}, {self._story[number - 1].title}"

    def _reading(self) -> None:
        """Find sensors that the controller reads and was not promised."""
        controller = self._make()
        read: dict[str, None] = {}
        for chapter in self._story:
            told = decode_observation(chapter.sent)
            watched = _Watched(*(getattr(told, field) for field in told.__struct_fields__))
            _reads[id(watched)] = read
            try:
                controller.step(watched)
            except Exception:
                break
            finally:
                del _reads[id(watched)]
        for field in read:
            if field not in self._given:
                self._note(f"step() reads observation.{field}, which it does not declare in `sensors`")


_reads: dict[int, dict[str, None]] = {}


class _Watched(Observation, frozen=True):
    """An observation that takes note of which sensors are read."""

    def __getattribute__(self, name: str) -> Any:
        if name in SENSOR_FIELDS and (read := _reads.get(id(self))) is not None:
            read[name] = None
        return super().__getattribute__(name)


def _first_difference(one: list[bytes | None], other: list[bytes | None]) -> int:
    """Return the number, from 1, of the first answer in which two lives differ, or 0."""
    for number, (a, b) in enumerate(zip(one, other, strict=False), start=1):
        if a != b:
            return number
    return 0


def _digest(answers: Sequence[bytes | None]) -> str:
    return blake2b(b"".join(answer or b"" for answer in answers), digest_size=16).hexdigest()


def _life_elsewhere(controller: type[Any], setup: Setup, story: list[bytes], hash_seed: str) -> str | None:
    """Return the digest of a life in a new interpreter, or None where that cannot import the controller by name."""
    module = sys.modules.get(controller.__module__)
    if controller.__module__ == "__main__" or getattr(module, controller.__qualname__, None) is not controller:
        return None
    task = msgspec.msgpack.encode((controller.__module__, controller.__qualname__, setup, story))
    run = subprocess.run(
        [sys.executable, "-c", f"import {__name__} as kit; kit.live_for_parent()"],
        input=task,
        capture_output=True,
        env=os.environ | {"PYTHONHASHSEED": hash_seed, "PYTHONPATH": os.pathsep.join(sys.path)},
        timeout=_CHILD_S,
        check=False,
    )
    return run.stdout.decode().strip() if run.returncode == 0 else None


def live_for_parent() -> None:
    """Live the life that standard input tells, and write its digest to standard output."""
    task = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=tuple[str, str, Setup, list[bytes]])
    module, name, setup, story = task
    try:
        found: Any = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError):
        sys.exit(_NOT_IMPORTABLE)
    controller, answers = found(setup), []
    for sent in story:
        observation = decode_observation(sent)
        command = controller.step(observation)
        command.tick = observation.tick
        answers.append(encode(command))
    sys.stdout.write(_digest(answers))


def _said(error: Exception) -> str:
    """Return an exception in a line, with the place that raised it if that is not the call here."""
    trace, line = error.__traceback__, f"{type(error).__name__}: {error}"
    if trace is None or trace.tb_next is None:
        return line
    while trace.tb_next is not None:
        trace = trace.tb_next
    return f"{line} at {trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:60] + "..."
