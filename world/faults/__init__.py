"""Faults: failures that a scenario schedules. The schedule is data: `[[faults]]` tables in the scenario.

Every fault begins at a time or on a condition. It lasts for a time, until a time, until a `heal`, or to the end of the run. A
fault is active in between, and the state of nodes, links and sensors at a tick follows from the active faults alone. One file
holds one kind, in `programs`, `air` or `sensing`; `schedule` begins and ends faults.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import ARRAY, NonNegative, Positive, Table
from zwerm.world.arena.arena import Arena
from zwerm.world.radio import NodeName, PacketJudge
from zwerm.world.radio.nodes import node_count, node_id
from zwerm.world.scene import Bools, Ints, Scene
from zwerm.world.sensors import Sensor

Nodes = Annotated[list[NodeName], Field(min_length=1)]
Robots = Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=1)]
Share = Annotated[float, Field(gt=0, le=1)]


class WhenTable(Table):
    """A condition: a metric of coverage has reached `at_least`, or `robot_deployed` has entered the arena."""

    metric: Literal["cell_coverage_fraction", "area_coverage_fraction"] | None = None
    at_least: Share | None = None
    robot_deployed: Annotated[int, Field(ge=0)] | None = None


class FaultTable(Table):
    """The beginning of a fault, `at_s` or `when`, and its end, `for_s` or `until_s`; without either, the end of the run.

    With `between_s`, the fault begins at a random time in that interval, by the seed.
    """

    at_s: NonNegative | None = None
    between_s: Annotated[tuple[NonNegative, NonNegative], ARRAY] | None = None
    when: WhenTable | None = None
    for_s: Positive | None = None
    until_s: Positive | None = None


@dataclass(frozen=True, slots=True)
class FaultContext:
    """The constants of a run that a fault may know. `purpose` keys its random numbers."""

    scenario: Scenario
    purpose: str

    @property
    def nodes(self) -> int:
        """The number of nodes: robots and coordinator."""
        return node_count(self.scenario)

    def ids(self, names: Sequence[NodeName]) -> list[int]:
        """Return the ids of named nodes."""
        return [node_id(name, self.scenario) for name in names]

    def mask(self, names: Sequence[NodeName]) -> Bools:
        """Return (nodes,) whether a node is named."""
        named = np.zeros(self.nodes, dtype=np.bool_)
        named[self.ids(names)] = True
        return named


class ProgramStates:
    """The effects of faults on programs, arrays (nodes,). Faults add to it; their order does not matter."""

    def __init__(self, nodes: int) -> None:
        self.down: Bools = np.zeros(nodes, dtype=np.bool_)
        self.paused: Bools = np.zeros(nodes, dtype=np.bool_)
        self.every_ticks: Ints = np.ones(nodes, dtype=np.int64)  # ticks that a node takes for an answer
        self.restarted: Bools = np.zeros(nodes, dtype=np.bool_)  # killed and started again at this tick


class Fault:
    """One fault of a run: the base class of the plug-in kind `fault`.

    The effects are methods: on programs, on the radio, on sensors. Each does nothing here; a subclass overrides those that it
    has, and states as class attributes all that other parts need to know. The schedule keeps the times.
    """

    Parameters: ClassVar[type[FaultTable]] = FaultTable

    # The fault lasts; otherwise it is active at one tick only.
    lasts: ClassVar[bool] = True
    # A `heal` ends the fault.
    healable: ClassVar[bool] = True
    # The fault ends all active faults that are healable.
    heals: ClassVar[bool] = False
    # The fault kills, starts, pauses or resumes programs: all of them must run under the control of the run.
    touches_programs: ClassVar[bool] = False
    # The twin reproduces the fault: it touches no program, and drops packets by positions and ids alone.
    in_network: ClassVar[bool] = False
    # The fault changes readings of sensors.
    alters_sensors: ClassVar[bool] = False

    def __init__(self, parameters: Any, context: FaultContext) -> None:
        """Take an instance of `Parameters` without mistakes."""
        self.parameters = parameters
        self.context = context

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return a line for each mistake of the parameters in this scenario, led by the rest of its path.

        For example `.nodes.0: no such robot: ids are 0 to 3, got 9`, or `: expected either nodes or fraction`.
        """
        return []

    # --- effects while it is active -----------------------------------------------------------------------------------

    def strike(self, scene: Scene, dead: Sequence[int]) -> Sequence[int]:
        """Choose the nodes that the fault strikes, if they are random, and return them once. `dead` are down for good.

        Called at every tick while the fault is active, before the other effects.
        """
        return ()

    def on_programs(self, states: ProgramStates) -> None:
        """Add the effect on programs to `states`."""

    def before(self, states: ProgramStates) -> None:
        """Add the effect on programs that the fault has until it begins."""

    def on_radio(self, channel: str) -> Sequence[PacketJudge]:
        """Return the judges of packets on a channel, `robots` or `uplink`. They judge before the models of the channel."""
        return ()

    def hides(self, sensor: Sensor) -> Bools | None:
        """Return (robots,) the robots that `sensor` is read without, or None for a normal reading."""
        return None

    def alters(self, sensor: Sensor) -> bool:
        """Return whether `alter` changes the readings of this sensor."""
        return False

    def alter(self, sensor: Sensor, readings: list[Any], scene: Scene, robots: Ints) -> None:
        """Change the readings in place, one for each of `robots` (ascending ids)."""

    # --- random schedules ---------------------------------------------------------------------------------------------

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return the parameters of a random fault but its times, or None: there are no random faults of this kind."""
        return None

    @classmethod
    def impossible(cls, scenario: Scenario) -> str:
        """Return the reason why no random fault of this kind can occur in a scenario, or an empty string."""
        return ""


def unknown_nodes(names: Sequence[NodeName] | None, path: str, scenario: Scenario) -> list[str]:
    """Return a line `path.index: rule` for each name that names no node."""
    found: list[str] = []
    for index, name in enumerate(names or ()):
        try:
            node_id(name, scenario)
        except ValueError as error:
            found.append(f"{path}.{index}: {error}")
    return found


def ticks(time_s: float, dt_s: float) -> int:
    """Return the first tick at or after `time_s`."""
    return math.ceil(time_s / dt_s - 1e-9)
