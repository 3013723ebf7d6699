"""Controllers by name: the built-in table, and `module:Class` for anyone else's."""

import importlib
from typing import Any, Final

import msgspec

from zwerm.agents.contract import NoParameters, Setup, Stepper
from zwerm.errors import ControllerError

BUILT_IN: Final = {
    "beacon": "zwerm.agents.gossip:Beacon",
    "computation-free": "zwerm.agents.computation_free:ComputationFree",
    "gossip-max": "zwerm.agents.gossip:GossipMax",
    "random-walk": "zwerm.agents.computation_free:RandomWalk",
    "sensor-coverage": "zwerm.agents.sensor_coverage:Robot",
    "voronoi-coverage": "zwerm.agents.voronoi_coverage:VoronoiCoverage",
    "voronoi-integer": "zwerm.agents.voronoi_coverage:IntegerCoverage",
    "voronoi-radio": "zwerm.agents.voronoi_coverage:RadioCoverage",
    "voronoi-swarmbot": "zwerm.agents.voronoi_coverage:SwarmBotCoverage",
}


def find(name: str) -> type[Any]:
    """Return the controller class that `name` names.

    Raises ControllerError, in one line, where there is none or it has no `step`.
    """
    path = BUILT_IN.get(name, name)
    module_name, _, class_name = path.partition(":")
    if not class_name:
        known = ", ".join(sorted(BUILT_IN))
        raise ControllerError(f"expected a built-in controller ({known}) or module:Class, got {name!r}")
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise ControllerError(f"cannot import {module_name!r}: {error}") from error
    found = getattr(module, class_name, None)
    if not isinstance(found, type):
        raise ControllerError(f"module {module_name!r} has no class {class_name!r}")
    if not callable(getattr(found, "step", None)):
        raise ControllerError(f"{name}: a controller needs a method step(observation) -> Command")
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
    return controller


def parameters_of(found: type[Any]) -> type[Any]:
    """Return the struct that types the controller's parameters."""
    kind: type[Any] = getattr(found, "Parameters", NoParameters)
    return kind
