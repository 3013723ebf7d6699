"""The contract between a controller and the program that runs it: observation in, command out.

A controller is a plain object. It does no I/O, reads no clock and imports no global randomness. Its `Setup` holds all
information about the node itself. Each `Observation` holds all information about its surroundings. `Controller` is a
convenience: any class with the same constructor and `step` is accepted.
"""

from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import msgspec
import numpy as np
from msgspec import Struct

from zwerm.maths.keyed_random import stream
from zwerm.wire.messages import Command, Observation


class NoParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """For a controller that takes no parameters."""


class Body(Struct, frozen=True, forbid_unknown_fields=True):
    """The properties of a robot's body that its controller gets."""

    kind: str  # the drive: differential, holonomic or module:Class
    radius_m: float  # of the round body [m]
    max_speed_m_s: float  # of a wheel, or of the body where it has none [m/s]
    max_turn_rad_s: float  # of a body without wheels [rad/s]
    wheel_base_m: float = 0.0  # distance of the wheels [m]; 0 without wheels


class Setup(Struct, frozen=True, forbid_unknown_fields=True):
    """All information that a node gets before its first observation.

    Only a coordinator gets `bases`, the ids of base stations. `services` names the provider of each service. A node
    that has lost its memory is a later `incarnation`.
    """

    node: int  # id: robots from 0, base stations first, then the coordinator
    role: str  # robot, base or coordinator
    dt_s: float  # duration of a tick [s]
    sensors: tuple[str, ...]  # kinds of the sensors that it has
    stream_key: bytes  # key of its own random numbers
    body: Body | None = None  # None for a coordinator
    channels: tuple[str, ...] = ()  # radio channels that it may send on
    parameters: dict[str, Any] = {}  # from the scenario, typed by Parameters
    bases: tuple[int, ...] = ()  # ids of base stations; only for a coordinator
    services: dict[str, str] = {}  # provider of each service, by name
    incarnation: int = 1  # 1, and one more after each restart


class Stepper(Protocol):
    """The interface that a runner needs of a controller."""

    def step(self, observation: Observation) -> Command:
        """Return the answer to one observation."""


class Controller:
    """Base class of the controllers that ship here.

    `sensors` names the observation fields the controller needs, `Parameters` types what a scenario may set.
    `self.random` is the node's own stream of random numbers, the same in every runner.
    """

    sensors: ClassVar[tuple[str, ...]] = ()
    Parameters: ClassVar[type[Struct]] = NoParameters

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.parameters: Any = msgspec.convert(setup.parameters, self.Parameters)

    if not TYPE_CHECKING:  # or any attribute of a controller would have a type

        def __getattr__(self, name: str) -> Any:
            """Explain why an attribute of this class is missing."""
            if name in ("setup", "parameters", "random") and "setup" not in vars(self):
                constructor = f"the constructor of {type(self).__name__}"
                raise AttributeError(f"no setup: {constructor} must call super().__init__(setup)")
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)

    @cached_property
    def random(self) -> np.random.Generator:
        """The node's own stream of random numbers, made when it is first used."""
        return stream(self.setup.stream_key)

    def step(self, observation: Observation) -> Command:
        """Return the answer to one observation."""
        raise TypeError(f"{type(self).__name__} defines no step()")
