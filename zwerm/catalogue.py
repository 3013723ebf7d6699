"""The catalogue: one row for each algorithm, and one for each plug-in of each kind.

Everything that lists, checks, preloads or documents algorithms and plug-ins reads this file. A row holds names only, as
`module:Class`, so that reading the catalogue imports nothing. A scenario may name a class outside the catalogue by
`module:Class` wherever it may name a row.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Final, Literal

Role = Literal["robot", "base", "coordinator"]

# Classes as `module:Class`, by role and then by the name that a scenario uses.
Controllers = Mapping[Role, Mapping[str, str]]

ROBOT: Final[Role] = "robot"
BASE: Final[Role] = "base"
COORDINATOR: Final[Role] = "coordinator"


@dataclass(frozen=True, slots=True)
class Variant:
    """The controllers that provide one combination of an algorithm's services.

    `services` has one provider for each service of the algorithm. Controllers that are not named here are the
    algorithm's own. `decides` is the role that ends the run. A variant with `coordinator=False` runs without that
    process.
    """

    services: Mapping[str, str]
    decides: Role
    controllers: Controllers = field(default_factory=dict)
    coordinator: bool = True
    radio: bool = False
    stations_max: int | None = None


@dataclass(frozen=True, slots=True)
class Algorithm:
    """One algorithm: its controllers by the name that a scenario uses, and all that comes with it.

    `variants` are tried in order: the first that agrees with the services a scenario names is taken. `metrics` are
    measured and `layers` drawn in every run of these controllers. Its scenarios and studies lie in folders called `name`.
    `reactive` names, by controller, the function that returns the wheel speeds of a robot in a batch (`zwerm.evolve.batch`).
    """

    name: str
    title: str
    paper: str = ""
    page: str = ""
    controllers: Controllers = field(default_factory=dict)
    variants: Sequence[Variant] = ()
    metrics: Sequence[str] = ()
    layers: Sequence[str] = ()
    reactive: Mapping[str, str] = field(default_factory=dict)


_SENSOR_COVERAGE: Final = "zwerm.agents.sensor_coverage"
_SENSOR_COVERAGE_COORDINATOR: Final = "zwerm.coordinator.sensor_coverage"
_SENSOR_COVERAGE_METRICS: Final = "zwerm.world.metrics.sensor_coverage"
_NEGOTIATING: Final[Controllers] = {
    ROBOT: {"sensor-coverage": f"{_SENSOR_COVERAGE}.negotiating_robot:NegotiatingRobot"},
    BASE: {"sensor-coverage": f"{_SENSOR_COVERAGE}.negotiating_robot:NegotiatingBase"},
}
_DECENTRALISED: Final[Controllers] = {
    ROBOT: {"sensor-coverage": f"{_SENSOR_COVERAGE}.local_robot:LocalRobot"},
    BASE: {"sensor-coverage": f"{_SENSOR_COVERAGE}.local_base:LocalBase"},
    COORDINATOR: {"sensor-coverage": f"{_SENSOR_COVERAGE_COORDINATOR}.redundancy_advisor:RedundancyAdvisor"},
}


def _decentralised(redundancy: str, coordinator: bool = False) -> Variant:
    """Return the variant of sensor coverage in which neighbours find the path, and `redundancy` the redundant
    robots."""
    services = {"path": "gradient", "redundancy": redundancy}
    return Variant(services, BASE, _DECENTRALISED, coordinator, radio=True, stations_max=1)


ALGORITHMS: Final[Sequence[Algorithm]] = (
    Algorithm(
        name="sensor_coverage",
        title="Sensor coverage with bearings and touch only",
        paper="Ramaithitima, Whitzer, Bhattacharya, Kumar 2015",
        page="papers/sensor-coverage.md",
        controllers={
            ROBOT: {"sensor-coverage": f"{_SENSOR_COVERAGE}.central_robot:CentralRobot"},
            BASE: {"sensor-coverage": f"{_SENSOR_COVERAGE}.central_base:CentralBase"},
            COORDINATOR: {"sensor-coverage": f"{_SENSOR_COVERAGE_COORDINATOR}.coordinator:SensorCoverageCoordinator"},
        },
        variants=(
            Variant({"path": "coordinator", "redundancy": "coordinator"}, decides=COORDINATOR),
            Variant({"path": "coordinator", "redundancy": "none"}, decides=COORDINATOR),
            Variant(
                {"path": "coordinator", "redundancy": "link"}, decides=COORDINATOR, radio=True, controllers=_NEGOTIATING
            ),
            _decentralised("none"),
            _decentralised("link"),
            _decentralised("coordinator", coordinator=True),
        ),
        metrics=(
            f"{_SENSOR_COVERAGE_METRICS}:Deployment",
            f"{_SENSOR_COVERAGE_METRICS}:Conclusion",
            f"{_SENSOR_COVERAGE_METRICS}:Removals",
        ),
        layers=("zwerm.view.layers.sensor_coverage:ComplexLayer",),
    ),
    Algorithm(
        name="voronoi_coverage",
        title="Voronoi coverage with sensory feedback",
        paper="Schwager, McLurkin, Rus 2006",
        page="papers/voronoi-coverage.md",
        controllers={
            ROBOT: {
                "voronoi-coverage": "zwerm.agents.voronoi_coverage:VoronoiCoverage",
                "voronoi-integer": "zwerm.agents.voronoi_coverage:IntegerCoverage",
                "voronoi-radio": "zwerm.agents.voronoi_coverage:RadioCoverage",
                "voronoi-swarmbot": "zwerm.agents.voronoi_coverage:SwarmBotCoverage",
            }
        },
    ),
    Algorithm(
        name="landmark_exploration",
        title="Landmark-based exploration with bearings and contact only",
        paper="Ramaithitima, Bhattacharya 2018",
        page="papers/landmark-exploration.md",
        controllers={
            ROBOT: {
                "landmark-exploration": "zwerm.agents.landmark_exploration:Explorer",
                "landmark-navigator": "zwerm.agents.landmark_exploration:Navigator",
            },
            COORDINATOR: {"landmark-exploration": "zwerm.coordinator.landmark_exploration:LandmarkCoordinator"},
        },
        variants=(
            Variant({"map": "coordinator", "assignment": "coordinator"}, decides=COORDINATOR),
            Variant({"map": "coordinator", "assignment": "claims"}, decides=COORDINATOR),
            Variant({"map": "gossip", "assignment": "coordinator"}, decides=COORDINATOR, radio=True),
            Variant({"map": "gossip", "assignment": "claims"}, decides=ROBOT, coordinator=False, radio=True),
        ),
        metrics=(
            "zwerm.world.metrics.landmark_exploration:Exploration",
            "zwerm.world.metrics.landmark_exploration:Navigation",
        ),
        layers=(
            "zwerm.view.layers.landmark_exploration:LandmarkNavigationLayer",
            "zwerm.view.layers.landmark_exploration:LandmarkComplexLayer",
        ),
    ),
    Algorithm(
        name="computation_free",
        title="Spatial coverage without computation",
        paper="Özdemir, Gauci, Kolling, Hall, Groß 2019",
        page="papers/computation-free.md",
        controllers={
            ROBOT: {
                "computation-free": "zwerm.agents.computation_free:ComputationFree",
                "random-walk": "zwerm.agents.computation_free:RandomWalk",
            }
        },
        reactive={"computation-free": "zwerm.agents.computation_free.reactive:wheel_fractions"},
    ),
    Algorithm(
        name="robot_teams",
        title="Sensor-based coverage by robot teams",
        paper="Latimer, Srinivasa, Lee-Shue, Sonne, Choset, Hurst 2002",
        page="papers/robot-teams.md",
        controllers={
            ROBOT: {"robot-teams": "zwerm.agents.robot_teams:TeamRobot"},
            COORDINATOR: {"robot-teams": "zwerm.coordinator.robot_teams:TeamCoordinator"},
        },
        variants=(
            Variant({"cells": "team"}, decides=ROBOT, coordinator=False),
            Variant({"cells": "coordinator"}, decides=COORDINATOR),
        ),
        metrics=("zwerm.world.metrics.robot_teams:TeamCoverage",),
        layers=("zwerm.view.layers.robot_teams:CellsLayer",),
    ),
    Algorithm(
        name="agreement",
        title="Agreement for teaching: averages, and leaders by leases",
        page="concepts/agreement.md",
        controllers={
            ROBOT: {
                "averaging": "zwerm.agents.agreement:Averaging",
                "leader-lease": "zwerm.agents.agreement:LeaderLease",
            }
        },
        metrics=("zwerm.world.metrics.agreement:Spread", "zwerm.world.metrics.agreement:Leaders"),
    ),
    Algorithm(
        name="gossip",
        title="Demonstrations of the radio: gossip and beacons",
        controllers={ROBOT: {"beacon": "zwerm.agents.gossip:Beacon", "gossip-max": "zwerm.agents.gossip:GossipMax"}},
    ),
)

# Commands of the command line, in the order of `zwerm --help`, as `module:function`.
COMMANDS: Final = {
    "list": "zwerm.cli.commands.list_command:list_catalogue",
    "show": "zwerm.cli.commands.show_command:show",
    "new": "zwerm.cli.commands.new_command:new",
    "check": "zwerm.cli.commands.check_command:check",
    "run": "zwerm.cli.commands.run_command:run",
    "world": "zwerm.cli.commands.world_command:world",
    "keys": "zwerm.cli.commands.keys_command:keys",
    "robot": "zwerm.cli.commands.robot_command:robot",
    "twin": "zwerm.cli.commands.twin_command:twin",
    "shrink": "zwerm.cli.commands.shrink_command:shrink",
    "study": "zwerm.cli.commands.study_command:study",
    "compare": "zwerm.cli.commands.compare_command:compare",
    "merge": "zwerm.cli.commands.merge_command:merge",
    "evolve": "zwerm.cli.commands.evolve_command:evolve",
}

SENSORS: Final = {
    "bearings": "zwerm.world.sensors.bearings:Bearings",
    "boundary": "zwerm.world.sensors.boundary:Boundary",
    "compass": "zwerm.world.sensors.compass:Compass",
    "field": "zwerm.world.sensors.field:FieldSensor",
    "landmarks": "zwerm.world.sensors.landmarks:Landmarks",
    "line_of_sight": "zwerm.world.sensors.line_of_sight:LineOfSightSensor",
    "neighbours": "zwerm.world.sensors.neighbours:NeighboursSensor",
    "odometry": "zwerm.world.sensors.odometry:Odometry",
    "pose": "zwerm.world.sensors.pose:PoseSensor",
    "touch": "zwerm.world.sensors.touch:Touch",
}

# The function that returns a sensor's class by its name, for tools that must not import the world.
SENSOR_LOOKUP: Final = "zwerm.world.sensors.registry:find"

FIELDS: Final = {
    "bitmap": "zwerm.world.fields.bitmap:Bitmap",
    "constant": "zwerm.world.fields.constant:Constant",
    "gaussians": "zwerm.world.fields.gaussians:Gaussians",
    "lamp": "zwerm.world.fields.lamp:Lamp",
    "linear": "zwerm.world.fields.linear:Linear",
}

# Drives, by the `kind` of `[robots.body]`.
DRIVES: Final = {
    "differential": "zwerm.world.bodies.differential:Differential",
    "holonomic": "zwerm.world.bodies.holonomic:Holonomic",
}

RADIO_MODELS: Final = {
    "range": "zwerm.world.radio.models.range:DiscRange",
    "line_of_sight": "zwerm.world.radio.models.line_of_sight:LineOfSightModel",
    "path_loss": "zwerm.world.radio.models.path_loss:PathLoss",
    "wall_attenuation": "zwerm.world.radio.models.wall_attenuation:WallAttenuation",
    "loss": "zwerm.world.radio.models.loss:Loss",
    "gilbert_elliott": "zwerm.world.radio.models.gilbert_elliott:GilbertElliott",
    "delay": "zwerm.world.radio.models.delay:Delay",
    "duplication": "zwerm.world.radio.models.duplication:Duplication",
    "corruption": "zwerm.world.radio.models.corruption:Corruption",
    "rate_limit": "zwerm.world.radio.models.rate_limit:RateLimit",
    "collision": "zwerm.world.radio.models.collision:Collision",
}

FAULTS: Final = {
    "crash": "zwerm.world.faults.programs.crash:Crash",
    "restart": "zwerm.world.faults.programs.restart:Restart",
    "pause": "zwerm.world.faults.programs.pause:Pause",
    "slow": "zwerm.world.faults.programs.slow:Slow",
    "join": "zwerm.world.faults.programs.join:Join",
    "partition": "zwerm.world.faults.air.partition:Partition",
    "jam": "zwerm.world.faults.air.jam:Jam",
    "blackout": "zwerm.world.faults.air.blackout:Blackout",
    "cut": "zwerm.world.faults.air.cut:Cut",
    "camera_blackout": "zwerm.world.faults.sensing.camera_blackout:CameraBlackout",
    "dead_beacon": "zwerm.world.faults.sensing.dead_beacon:DeadBeacon",
    "stuck_touch": "zwerm.world.faults.sensing.stuck_touch:StuckTouch",
    "sensor_noise": "zwerm.world.faults.sensing.sensor_noise:SensorNoise",
    "heal": "zwerm.world.faults.heal:Heal",
}

# Metrics by the key of `[metrics]` that switches them on; the value of the key is validated by the class's `Parameters`.
METRICS: Final = {
    "cells": "zwerm.world.metrics.position_coverage:CellCoverage",
    "coverage_radius_m": "zwerm.world.metrics.position_coverage:AreaCoverage",
    "voronoi": "zwerm.world.metrics.voronoi_coverage:VoronoiMetrics",
    "sight_range_m": "zwerm.world.metrics.sight_coverage:SightCoverage",
}


# Layers that every picture may have. A layer draws only if the scenario or the command asks for it.
PICTURE_LAYERS: Final = (
    "zwerm.view.layers.radio_links:RadioLinks",
    "zwerm.view.layers.telemetry_colours:TelemetryColours",
)


def plugins() -> dict[str, Mapping[str, str]]:
    """Return the rows of every kind of plug-in."""
    return {
        "sensor": SENSORS,
        "field": FIELDS,
        "drive": DRIVES,
        "radio model": RADIO_MODELS,
        "fault": FAULTS,
        "metric": METRICS,
        "command": COMMANDS,
    }


@lru_cache(maxsize=2)
def shipped(kind: Literal["scenarios", "studies"]) -> Mapping[str, Path]:
    """Return the files of a kind that ship with Zwerm, by name, in alphabetical order."""
    files = Path(__file__).with_name(kind).glob("*/*.toml")
    return {path.stem: path for path in sorted(files, key=lambda each: each.stem)}


def row_of(file: Path) -> Algorithm | None:
    """Return the row to which a scenario or study belongs that ships with Zwerm, or None."""
    return next((row for row in ALGORITHMS if row.name == file.parent.name), None)


@lru_cache(maxsize=256)
def algorithm_of(controller: str) -> Algorithm | None:
    """Return the row that has a controller of this name, of any role, or None."""
    for row in ALGORITHMS:
        if any(controller in group for group in row.controllers.values()):
            return row
    return None


def layers_of(controller: str) -> Sequence[str]:
    """Return the picture layers of the algorithm that has a controller of this name."""
    row = algorithm_of(controller)
    return () if row is None else row.layers


def names(role: Role) -> list[str]:
    """Return the names of all controllers of a role, in the order of the rows."""
    return [name for row in ALGORITHMS for name in row.controllers.get(role, {})]


def controller_classes() -> Iterator[str]:
    """Yield every class of the catalogue that may run on a node, of all roles and variants, each once."""
    groups = [group for row in ALGORITHMS for group in (row.controllers, *(each.controllers for each in row.variants))]
    yield from dict.fromkeys(path for roles in groups for group in roles.values() for path in group.values())
