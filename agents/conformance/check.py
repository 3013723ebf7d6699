"""Test whether a controller fulfils the contract: `check(MyController)`, from any test suite.

The kit makes and steps the controller as a runner does. The observations are ordinary and unusual: empty readings, many
readings, malformed packets, a very late tick. The controller must answer each observation with a command that the world
accepts. Its answers must not depend on other controllers in the process, and it must not do what `purity` detects. All
violations are reported at once. The kit is no proof: it uses a few hundred
observations.
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
from zwerm.agents.conformance.stimuli import StimulusSetup, make_stimuli, sensor_class
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
    encode_command,
    open_answer,
)

_DRAWS: Final = Draws(2019)
_BODIES: Final = (
    Body("differential", radius_m=0.037, max_speed_m_s=0.128, max_turn_rad_s=6.0, wheel_base_m=0.051),
    Body("holonomic", radius_m=0.1, max_speed_m_s=0.5, max_turn_rad_s=3.0),
)
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
    """Raise ConformanceError with every violation of the contract by `controller`.

    `parameters` and `sensors` are the scenario's; by default the sensors that the controller declares. `channels` are the
    radio's channels, `()` for none. `extra` holds a reading of each sensor that is not found by its name. The controller must
    work on one of two bodies, an e-puck's or a holonomic one.
    """
    name = getattr(controller, "__qualname__", repr(controller))
    found = _declarations(controller, sensors, extra)
    if not found:
        given = tuple(controller_sensors(controller) if sensors is None else sensors)
        setups = [_setup(given, body, tuple(channels), dict(parameters or {})) for body in _BODIES]
        examinations = [_Examination(controller, setup, extra) for setup in setups]
        fitting = min(examinations, key=lambda each: (not each.fits, len(each.violations)))
        fitting.compare_other_processes()
        found = fitting.violations
    if found:
        raise ConformanceError(name, found)


def setup_violations(controller: type[Any], setup: Setup) -> list[str]:
    """Return the violations of the contract by `controller` on a node with exactly this Setup, in this process.

    The answers are checked against the body and the channels of the Setup. A node without a body must not drive.
    """
    examination = _Examination(controller, setup, None)
    return [*_declarations(controller, setup.sensors, None), *examination.violations]


def controller_sensors(controller: type[Any]) -> tuple[str, ...]:
    """Return the sensors that a controller declares."""
    return tuple(getattr(controller, "sensors", ()))


def _declarations(
    controller: type[Any], sensors: Sequence[str] | None, extra: Mapping[str, tuple[float, ...]] | None
) -> list[str]:
    """Return the violations in the declarations of a controller class."""
    if not isinstance(controller, type):
        return [f"expected a class, got {controller!r}"]
    found = []
    if not callable(getattr(controller, "step", None)):
        found.append("it has no method step(observation)")
    declared = getattr(controller, "sensors", ())
    given = () if sensors is None else sensors
    fields = [kind.field for each in given if (kind := sensor_class(each)) is not None]
    if not isinstance(declared, tuple | list) or not all(isinstance(each, str) for each in declared):
        return [*found, f"sensors: expected a tuple of names, got {declared!r}"]
    for sensor in declared:
        if sensor_class(sensor) is None and sensor not in fields and not extra:
            found.append(f"sensors: {sensor!r} is none that Zwerm knows; give a reading of your own with extra=")
        if sensors is not None and sensor not in (*given, *fields):
            found.append(f"sensors: it declares {sensor!r}, which check() does not give")
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
        self.fits = True  # the controller accepts this body and its drive commands fit it
        sensors = tuple(found for sensor in setup.sensors if (found := sensor_class(sensor)) is not None)
        self._stimuli = make_stimuli(StimulusSetup(sensors, setup.channels, extra or {}, setup.dt_s))
        first = decode_observation(self._stimuli[0].sent)
        self._given = {field for field in SENSOR_FIELDS if getattr(first, field) is not None}
        with PurityMonitor() as monitor:
            self._answers: list[bytes | None] | None = None
            if self._make() is not None:
                self._each_alone()
                self._answers = self._repeated_runs()
                self._undeclared_sensors()
        self.violations += monitor.found

    def _record(self, violation: str) -> None:
        if violation not in self.violations:
            self.violations.append(violation)

    def _make(self, node: int = 0) -> Any:
        """Return a new controller with its own Setup, or None after noting a violation."""
        key = self._setup.stream_key if node == 0 else _DRAWS.stream_key("conformance", node)
        sent = encode(msgspec.structs.replace(self._setup, node=node, stream_key=key))
        setup = msgspec.msgpack.decode(sent, type=Setup)
        try:
            made = self._controller(setup)
        except (msgspec.ValidationError, ControllerError) as error:
            self.fits = False
            self._record(f"the constructor refuses its Setup: {error}")
            return None
        except Exception as error:
            self._record(f"the constructor raised {_in_one_line(error)}")
            return None
        if encode(setup) != sent:
            self._record("the constructor changes its Setup")
        return made

    def _step(self, controller: Any, sent: bytes, when: str) -> bytes | None:
        """Return the encoded answer to one encoded observation, or None after noting a violation."""
        observation = decode_observation(sent)
        try:
            command = controller.step(observation)
        except Exception as error:
            self._record(f"step() raised {_in_one_line(error)}, on {when}")
            return None
        if encode(observation) != sent:
            self._record(f"step() changes the observation, on {when}")
        if not isinstance(command, Command):
            self._record(f"step() returned {_short(command)}, expected a Command, on {when}")
            return None
        command.tick = observation.tick
        return self._answer(command, when)

    def _answer(self, command: Command, when: str) -> bytes | None:
        """Return the encoded command, or None after noting why the world would refuse it."""
        try:
            payload = encode_command(command)
            open_answer(payload)
        except (TypeError, ValueError, OverflowError, RecursionError) as error:
            self._record(f"step() returned what cannot be encoded: {error}, on {when}")
            return None
        except ProtocolError as error:
            self._record(f"step() returned what the world refuses: {error}, on {when}")
            return None
        body = self._setup.body
        if command.drive is not None and body is None:
            self._record(f"step() drives with {type(command.drive).__name__}, but its Setup names no body, on {when}")
        if command.drive is not None and body is not None and type(command.drive) is not _drive_of(body):
            self.fits = False
            expected = f"takes {_drive_of(body).__name__}"
            self._record(
                f"step() drives a {body.kind} body with {type(command.drive).__name__}; it {expected}, on {when}"
            )
        for message in command.outbox:
            if message.channel not in self._setup.channels:
                known = ", ".join(self._setup.channels) or "none"
                self._record(f"step() sends on channel {message.channel!r}; its Setup names {known}, on {when}")
            if message.to is not None and message.to < 0:
                self._record(f"step() sends to node {message.to}, on {when}")
        return payload

    def _each_alone(self) -> None:
        """Give each kind of observation to a new controller as its first one."""
        first = {stimulus.title: stimulus for stimulus in reversed(self._stimuli)}
        for title in sorted(first):
            controller = self._make()
            if controller is not None:
                self._step(controller, first[title].sent, f"{title} as its first observation")

    def _run(self, controller: Any, beside: Any = None) -> list[bytes | None]:
        """Return a controller's answers to all stimuli. `beside` is another controller that gets each stimulus first."""
        answers = []
        for number, stimulus in enumerate(self._stimuli):
            when = f"observation {number} ({stimulus.title})"
            if beside is not None:
                self._step(beside, stimulus.sent, when)
            answers.append(self._step(controller, stimulus.sent, when))
            if answers[-1] is None:
                break
        return answers

    def _repeated_runs(self) -> list[bytes | None] | None:
        """Run equal controllers and compare their answers; return the answers if all are equal."""
        one = self._run(self._make())
        if None in one:
            return None
        again = self._run(self._make())
        if number := _first_difference(one, again):
            self._record(
                "two controllers with the same Setup answer the same observations differently: state that instances share,"
                f" or chance that is not the stream of the Setup ({self._when(number)})"
            )
            return None
        other = self._make(node=1)
        if number := _first_difference(one, self._run(self._make(), beside=other)):
            self._record(
                f"its answers change when another controller runs in the same process: shared state ({self._when(number)})"
            )
            return None
        return one

    def compare_other_processes(self) -> None:
        """Compare the answers with those from new interpreters with other string hashes."""
        if self._answers is None:
            return
        observations = [each.sent for each in self._stimuli]
        for hash_seed in _HASH_SEEDS:
            digest = _digest_in_new_process(self._controller, self._setup, observations, hash_seed)
            if digest is not None and digest != _digest(self._answers):
                self._record(
                    "its answers differ in another process with another PYTHONHASHSEED:"
                    " the order of a set, or hash(), decides something; sort it"
                )
                return

    def _when(self, number: int) -> str:
        return f"first at observation {number - 1}, {self._stimuli[number - 1].title}"

    def _undeclared_sensors(self) -> None:
        """Note the sensors that the controller reads without declaring them."""
        controller = self._make()
        read: dict[str, None] = {}
        for stimulus in self._stimuli:
            decoded = decode_observation(stimulus.sent)
            watched = _Watched(*(getattr(decoded, field) for field in decoded.__struct_fields__))
            _reads[id(watched)] = read
            try:
                controller.step(watched)
            except Exception:
                break
            finally:
                del _reads[id(watched)]
        for field in read:
            if field not in self._given:
                self._record(f"step() reads observation.{field}, which it does not declare in `sensors`")


_reads: dict[int, dict[str, None]] = {}


class _Watched(Observation, frozen=True):
    """An observation that records which sensors are read."""

    def __getattribute__(self, name: str) -> Any:
        if name in SENSOR_FIELDS and (read := _reads.get(id(self))) is not None:
            read[name] = None
        return super().__getattribute__(name)


def _first_difference(one: list[bytes | None], other: list[bytes | None]) -> int:
    """Return the number, from 1, of the first answer that differs, or 0."""
    for number, (a, b) in enumerate(zip(one, other, strict=False), start=1):
        if a != b:
            return number
    return 0


def _digest(answers: Sequence[bytes | None]) -> str:
    return blake2b(b"".join(answer or b"" for answer in answers), digest_size=16).hexdigest()


def _digest_in_new_process(
    controller: type[Any], setup: Setup, observations: list[bytes], hash_seed: str
) -> str | None:
    """Return the digest of the answers in a new interpreter, or None if it cannot import the controller by name."""
    module = sys.modules.get(controller.__module__)
    if controller.__module__ == "__main__" or getattr(module, controller.__qualname__, None) is not controller:
        return None
    task = msgspec.msgpack.encode((controller.__module__, controller.__qualname__, setup, observations))
    run = subprocess.run(
        [sys.executable, "-c", f"import {__name__} as kit; kit.answer_for_parent()"],
        input=task,
        capture_output=True,
        env=os.environ | {"PYTHONHASHSEED": hash_seed, "PYTHONPATH": os.pathsep.join(sys.path)},
        timeout=_CHILD_S,
        check=False,
    )
    return run.stdout.decode().strip() if run.returncode == 0 else None


def answer_for_parent() -> None:
    """Run the controller and the observations from standard input; write the digest of the answers."""
    task = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=tuple[str, str, Setup, list[bytes]])
    module, name, setup, observations = task
    try:
        found: Any = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError):
        sys.exit(_NOT_IMPORTABLE)
    controller, answers = found(setup), []
    for sent in observations:
        observation = decode_observation(sent)
        command = controller.step(observation)
        command.tick = observation.tick
        answers.append(encode_command(command))
    sys.stdout.write(_digest(answers))


def _in_one_line(error: Exception) -> str:
    """Return an exception in one line, with the place that raised it unless that is the call here."""
    trace, line = error.__traceback__, f"{type(error).__name__}: {error}"
    if trace is None or trace.tb_next is None:
        return line
    while trace.tb_next is not None:
        trace = trace.tb_next
    return f"{line} at {trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}"


def _drive_of(body: Body) -> type[Any]:
    """Return the command type that drives a body: a body with wheels takes their speeds."""
    return WheelSpeeds if body.wheel_base_m > 0 else BodyVelocity


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:60] + "..."
