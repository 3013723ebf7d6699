"""Controllers by name: the built-in table, and `module:Class` for anyone else's."""

from typing import Any, Final

import msgspec

from zwerm.agents.runtime.contract import NoParameters, Setup, Stepper
from zwerm.errors import ControllerError
from zwerm.scenario.plugin_names import class_named

BUILT_IN: Final = {
    "beacon": "zwerm.agents.gossip:Beacon",
    "computation-free": "zwerm.agents.computation_free:ComputationFree",
    "gossip-max": "zwerm.agents.gossip:GossipMax",
    "random-walk": "zwerm.agents.computation_free:RandomWalk",
    "robot-teams": "zwerm.agents.robot_teams:TeamRobot",
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
    try:
        found = class_named(BUILT_IN.get(name, name), "controller", sorted(BUILT_IN))
    except ValueError as error:
        raise ControllerError(str(error)) from error
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
