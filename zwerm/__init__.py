"""Zwerm emulates robot swarms as what they are: many processes that pass messages, with bit-identical runs.

This is the public API: every name that documentation uses is imported from here. A name is imported from its module at
its first use. So `from zwerm import Controller` in a robot's process imports neither the world nor its libraries. Names
that are not in `__all__`, and all modules below this one, may change without notice: see CONTRIBUTING.md.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from zwerm.version import __version__

if TYPE_CHECKING:
    from zwerm.agents.conformance.check import check as check_controller
    from zwerm.agents.runtime.contract import Body, Controller, Setup
    from zwerm.errors import (
        ControllerError,
        LinkError,
        MissingExtraError,
        PictureError,
        ProtocolError,
        ScenarioError,
        StragglerError,
        ZwermError,
    )
    from zwerm.run.positions import Positions
    from zwerm.run.result import RunResult
    from zwerm.run.runner import run
    from zwerm.scenario.load import load
    from zwerm.scenario.tables import Scenario
    from zwerm.scenario.types import Table
    from zwerm.view.layer import Layer
    from zwerm.wire.messages import (
        Bearing,
        BodyVelocity,
        Command,
        Contact,
        Displacement,
        FieldSample,
        LandmarkBearing,
        Neighbour,
        Observation,
        Packet,
        Pose,
        Transmission,
        Wake,
        WheelSpeeds,
    )
    from zwerm.world.bodies import Drive
    from zwerm.world.faults import Fault, FaultContext, FaultTable, ProgramStates
    from zwerm.world.fields import Field
    from zwerm.world.metrics import Metric, MetricContext, Truth
    from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
    from zwerm.world.scene import Scene
    from zwerm.world.sensors import Sensor, Surroundings
    from zwerm.world.tick.telemetry import TelemetryArrays, TelemetryRecord

# The public names, by the module that defines them.
_NAMES: Final = {
    "zwerm.run.positions": ("Positions",),
    "zwerm.run.result": ("RunResult",),
    "zwerm.scenario.load": ("load",),
    "zwerm.scenario.tables": ("Scenario",),
    "zwerm.scenario.types": ("Table",),
    # controllers
    "zwerm.agents.runtime.contract": ("Body", "Controller", "Setup"),
    "zwerm.wire.messages": (
        *("Observation", "Command", "BodyVelocity", "WheelSpeeds", "Transmission", "Wake"),
        *("Bearing", "Contact", "Displacement", "FieldSample", "LandmarkBearing", "Neighbour", "Packet", "Pose"),
    ),
    # plug-ins: base classes and what they are given
    "zwerm.world.sensors": ("Sensor", "Surroundings"),
    "zwerm.world.scene": ("Scene",),
    "zwerm.world.radio": ("ModelContext", "Packets", "RadioModel", "RadioModelTable", "Transmissions", "Verdict"),
    "zwerm.world.faults": ("Fault", "FaultContext", "FaultTable", "ProgramStates"),
    "zwerm.world.bodies": ("Drive",),
    "zwerm.world.fields": ("Field",),
    "zwerm.world.metrics": ("Metric", "MetricContext", "Truth"),
    "zwerm.world.tick.telemetry": ("TelemetryArrays", "TelemetryRecord"),
    "zwerm.view.layer": ("Layer",),
    "zwerm.errors": (
        *("ZwermError", "ScenarioError", "ControllerError", "ProtocolError", "StragglerError", "LinkError"),
        *("PictureError", "MissingExtraError"),
    ),
}
_HOMES: Final = {name: (module, name) for module, names in _NAMES.items() for name in names} | {
    "check_controller": ("zwerm.agents.conformance.check", "check"),
}

__all__ = [
    "Bearing",
    "Body",
    "BodyVelocity",
    "Command",
    "Contact",
    "Controller",
    "ControllerError",
    "Displacement",
    "Drive",
    "Fault",
    "FaultContext",
    "FaultTable",
    "Field",
    "FieldSample",
    "LandmarkBearing",
    "Layer",
    "LinkError",
    "Metric",
    "MetricContext",
    "MissingExtraError",
    "ModelContext",
    "Neighbour",
    "Observation",
    "Packet",
    "Packets",
    "PictureError",
    "Pose",
    "Positions",
    "ProgramStates",
    "ProtocolError",
    "RadioModel",
    "RadioModelTable",
    "RunResult",
    "Scenario",
    "ScenarioError",
    "Scene",
    "Sensor",
    "Setup",
    "StragglerError",
    "Surroundings",
    "Table",
    "TelemetryArrays",
    "TelemetryRecord",
    "Transmission",
    "Transmissions",
    "Truth",
    "Verdict",
    "Wake",
    "WheelSpeeds",
    "ZwermError",
    "__version__",
    "check_controller",
    "load",
    "run",
]


def __getattr__(name: str) -> Any:
    if name == "run":  # the package of that name, which can be called
        return import_module("zwerm.run")
    if name in _HOMES:
        module, attribute = _HOMES[name]
        return getattr(import_module(module), attribute)
    raise AttributeError(f"module 'zwerm' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
