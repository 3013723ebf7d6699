"""Controllers by name: those of the catalogue, and `module:Class` for any other."""

import inspect
import traceback
from hashlib import blake2b
from pathlib import Path
from typing import Any, Final

import msgspec

from zwerm.agents.runtime.contract import Controller, NoParameters, Setup, Stepper
from zwerm.catalogue import ROBOT, algorithm_of, names
from zwerm.errors import ControllerError
from zwerm.scenario.plugin_names import class_named, takes

# The names of the catalogue's controllers, for messages.
BUILT_IN: Final = sorted(names(ROBOT))


def find(name: str) -> type[Any]:
    """Return the controller class that `name` names.

    Raises ControllerError, in one line, where there is none or it has no `step`.
    """
    try:
        row = algorithm_of(name)
        built_in = {} if row is None else row.controllers.get(ROBOT, {})
        found = class_named(built_in.get(name, name), "controller", BUILT_IN)
    except ValueError as error:
        raise ControllerError(str(error)) from error
    step = getattr(found, "step", None)
    if not callable(step) or step is Controller.step:
        raise ControllerError(f"{name}: a controller needs a method step(observation) -> Command")
    if not takes(found, 1):
        raise ControllerError(f"{name}: a controller's constructor takes its Setup: __init__(self, setup)")
    sensors = getattr(found, "sensors", ())
    if isinstance(sensors, str):
        raise ControllerError(f"{name}: its sensors must be a tuple of names, such as ({sensors!r},), got {sensors!r}")
    kind: Any = parameters_of(found)
    if not isinstance(kind, type) or not issubclass(kind, msgspec.Struct):
        raise ControllerError(f"{name}: its Parameters must be a subclass of msgspec.Struct, got {kind!r}")
    return found


def make(name: str, setup: Setup) -> Stepper:
    """Return the controller `name`, made for `setup`.

    Raises ControllerError where it cannot be found or its parameters do not fit.
    """
    found = find(name)
    try:
        controller: Stepper = found(setup)
    except msgspec.ValidationError as error:
        raise ControllerError(f"{name}: {error}") from None
    except ControllerError:
        raise
    except (Exception, SystemExit) as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{last.filename}:{last.lineno}"
        raise ControllerError(f"{name}: its constructor raised {type(error).__name__}: {error} ({where})") from error
    return controller


def code_of(name: str) -> str:
    """Return a digest of the file that defines a controller, or "" where it has none. Raises ControllerError."""
    try:
        file = inspect.getsourcefile(find(name))
    except TypeError:
        return ""
    return "" if file is None else blake2b(Path(file).read_bytes(), digest_size=16).hexdigest()


def step_place(found: type[Any]) -> str:
    """Return the place of a controller's `step`, such as " (mine.py:12, in Mine.step)", or "" where that is not known."""
    code = getattr(inspect.unwrap(found.step), "__code__", None)
    return "" if code is None else f" ({Path(code.co_filename).name}:{code.co_firstlineno}, in {found.__name__}.step)"


def parameters_of(found: type[Any]) -> type[Any]:
    """Return the struct that types the controller's parameters."""
    kind: type[Any] = getattr(found, "Parameters", NoParameters)
    return kind
