"""Several base stations: their depots, their frames that become one where swarms meet, and pushes at once that do not cross."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from zwerm.agents.sensor_coverage.frontier.attempt_log import AttemptLog
from zwerm.agents.sensor_coverage.frontier.paths import CheapestRoutes, Dijkstra
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import Sighting
from zwerm.coordinator.sensor_coverage.assignment import CheapestFirst
from zwerm.coordinator.sensor_coverage.command_mailbox import run_concurrently
from zwerm.deploy.node_specs import node_specs
from zwerm.errors import ScenarioError
from zwerm.maths.simplicial import FlagComplex
from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.wire.messages import Wake

HALL = ("arena.size_m=[4.2,2.6]", "robots.count=40", "base.poses=[[0.2,1.3,0.0],[4.0,1.3,3.0]]")
NOISE = "robots.sensors.0.sd_rad=0.0436332"
# Walls are followed one at a time, whatever the number of pushes.
PAPER = ['coordinator.parameters.walls="paper"']

Point = tuple[float, float]


# --- stations and depots --------------------------------------------------------------------------------------------


def test_robots_are_distributed_to_the_depots_one_by_one_and_an_empty_depot_refuses() -> None:
    world = assemble(load("sensor-coverage-multi-source", ("robots.count=9",)), 1)
    depots = world.bodies.depots
    assert depots is not None
    out = []
    for station in (2, 0, 1, 1, 1):
        depots.release(station)
        entering = depots.entering(world.scene)
        out.append(None if entering is None else (entering[0], *entering[1].tolist()))
    assert out == [(5, 5.5, 7.3), (3, 0.2, 3.75), (4, 8.8, 1.0), (7, 8.8, 1.0), None]
    assert depots.refused_releases == 1


def test_of_robots_released_at_once_one_enters_a_tick() -> None:
    world = assemble(load("sensor-coverage-multi-source", ("robots.count=9",)), 1)
    assert world.bodies.depots is not None
    for station in (1, 0):
        world.bodies.depots.release(station)
    entering = [world.bodies.depots.entering(world.scene) for _ in range(3)]
    assert [each and each[0] for each in entering] == [4, 3, None]


def test_every_station_is_a_node_and_only_the_coordinator_gets_their_ids() -> None:
    specs = node_specs(load("sensor-coverage-multi-source"), 1)
    assert [node for node, (_, setup) in specs.items() if setup.role == "base"] == [0, 1, 2]
    assert {node: setup.bases for node, (_, setup) in specs.items() if setup.bases} == {160: (0, 1, 2)}


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        (("base.pose=[1,1,0]",), "base: expected at most one of pose, poses and count, got pose and poses"),
        (("base.count=2",), "base: expected at most one of pose, poses and count, got poses and count"),
        (("base.poses=[]",), "base.poses: expected 1 items at least, got []"),
        (("base.poses=[[1]]",), "base.poses.0: expected 2 items at least, got [1]"),
        (("base.poses=[[1,1,0],[0,1,0]]",), "base.poses.1: expected free space 0.07 m around, got (0, 1)"),
        (("base.poses=[[1,1,0],[1.1,1,0]]",), "base.poses.1: expected 0.14 m to robot 0, got 0.1 m"),
        (("robots.count=3",), "robots.count: expected more than the 3 base stations, got 3"),
    ],
)
def test_invalid_base_stations_are_one_line(settings: tuple[str, ...], line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        assemble(load("sensor-coverage-multi-source", settings), 1)
    assert [each.partition(": ")[2] for each in caught.value.mistakes] == [line]


def test_stations_without_poses_stand_at_random_free_places() -> None:
    scenario = load("sensor-coverage-map", ("base.count=3",))
    one, other = assemble(scenario, 1).scene.position[:3], assemble(scenario, 2).scene.position[:3]
    assert len(np.unique(one, axis=0)) == 3
    assert not np.allclose(one, other)


# --- frames ---------------------------------------------------------------------------------------------------------


@dataclass
class Truth:
    """Robots at places, each in a body frame turned by its own angle: who sees whom is up to the test."""

    position: dict[int, Point]
    turned: dict[int, float]
    slots: Slots = field(default_factory=Slots)

    def update(self, *pairs: tuple[int, int]) -> None:
        sees: dict[int, list[int]] = {robot: [] for robot in self.position}
        for a, b in pairs:
            sees[a].append(b)
            sees[b].append(a)
        for robot, others in sees.items():
            seen = [Sighting(each, self.bearing(robot, each) - self.turned[robot]) for each in sorted(others)]
            self.slots.take(robot, seen)
        self.slots.learn_headings(sorted(self.position))
        self.slots.learn_references(self.slots.views())

    def bearing(self, a: int, b: int) -> float:
        (ax, ay), (bx, by) = self.position[a], self.position[b]
        return math.atan2(by - ay, bx - ax)

    def off(self, robot: int) -> float:
        """Return the rotation between the stored directions of a robot and the true ones."""
        return math.remainder(self.slots.heading[robot] - self.turned[robot], math.tau)


def two_swarms() -> Truth:
    position = {0: (0.0, 0.0), 1: (3.0, 0.0), 2: (0.9, 0.1), 3: (0.5, 0.8), 4: (2.1, 0.0), 5: (2.5, 0.8)}
    truth = Truth(position, {0: 0.3, 1: 2.0, 2: -1.0, 3: 3.0, 4: 0.7, 5: -2.2})
    for robot in position:
        truth.slots.add(robot)
    return truth


def test_the_directions_of_a_swarm_are_in_the_frame_of_its_station() -> None:
    truth = two_swarms()
    truth.update((0, 2), (0, 3), (2, 3), (1, 4), (1, 5), (4, 5))
    assert [truth.slots.frame[robot] for robot in range(6)] == [0, 1, 0, 0, 1, 1]
    assert [truth.off(robot) for robot in (0, 2, 3)] == pytest.approx([-0.3] * 3)
    assert [truth.off(robot) for robot in (1, 4, 5)] == pytest.approx([-2.0] * 3)


def test_two_frames_merge_where_swarms_see_each_other_and_all_stored_directions_turn() -> None:
    truth = two_swarms()
    apart = ((0, 2), (0, 3), (2, 3), (1, 4), (1, 5), (4, 5))
    truth.update(*apart)
    truth.slots.walls[4] = [truth.bearing(4, 5) + truth.off(4)]
    truth.slots.blocked[5] = [truth.bearing(5, 1) + truth.off(5)]
    truth.slots.walls[2] = [0.25]
    truth.update(*apart, (2, 4), (3, 4))
    assert set(truth.slots.frame.values()) == {0}
    assert [truth.off(robot) for robot in range(6)] == pytest.approx([-0.3] * 6)
    assert truth.slots.walls[4] == pytest.approx([truth.bearing(4, 5) - 0.3])
    assert truth.slots.blocked[5] == pytest.approx([truth.bearing(5, 1) - 0.3])
    assert truth.slots.walls[2] == [0.25]
    for a, b in (*apart, (2, 4), (3, 4)):
        for one, other in ((a, b), (b, a)):
            add = truth.slots.direction(one, other)
            assert add is not None
            assert math.remainder(add - truth.bearing(one, other) + 0.3, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_three_frames_merge_in_a_single_scan() -> None:
    truth = Truth({n: (0.9 * n, 0.1 * (n % 2)) for n in range(3)}, {0: 1.0, 1: -1.0, 2: 2.5})
    for robot in range(3):
        truth.slots.add(robot)
    truth.update((0, 1), (1, 2))
    assert [truth.off(robot) for robot in range(3)] == pytest.approx([-1.0] * 3)


# --- pushes at once -------------------------------------------------------------------------------------------------


def line_of(count: int) -> FlagComplex:
    return FlagComplex({n: [each for each in (n - 1, n + 1) if 0 <= each < count] for n in range(count)})


def plan(mover: int, *key: int) -> Plan:
    return Plan(key or (mover, mover, 1), mover, 0.0, 0.95, 0.8, (mover,))


def assigned(
    complex_: FlagComplex, sources: dict[int, float], *tiers: list[Plan], pushes_max: int = 9
) -> list[tuple[int, ...]]:
    def routes(part: FlagComplex, starts: dict[int, float]) -> CheapestRoutes:
        return Dijkstra(3.0).routes(part, starts, ())

    service = CheapestFirst(Slots(), pushes_max, AttemptLog(1, 0.3))
    found = service.assign(tiers, ScanResult({}, complex_, ()), sources, routes)  # type: ignore[arg-type]
    return [each.path for each in found]


def test_pushes_from_two_stations_go_at_once_where_their_paths_have_no_landmark_in_common() -> None:
    wanted = [plan(2), plan(7)]
    assert assigned(line_of(10), {0: 0.0, 9: 0.0}, wanted) == [(0, 1, 2), (9, 8, 7)]
    assert assigned(line_of(10), {0: 0.0, 9: 0.0}, wanted, pushes_max=1) == [(0, 1, 2)]


@pytest.mark.parametrize("mover", [5, 4, 3])
def test_a_push_whose_path_is_near_another_waits(mover: int) -> None:
    assert assigned(line_of(10), {0: 0.0, 9: 0.0}, [plan(3), plan(mover)])[1:] == []


def test_two_pushes_from_one_station_never_go_at_once() -> None:
    star = FlagComplex({0: [1, 5], 1: [0, 2], 2: [1, 3], 3: [2, 4], 4: [3], 5: [0, 6], 6: [5, 7], 7: [6, 8], 8: [7]})
    assert assigned(star, {0: 0.0}, [plan(4), plan(8)]) == [(0, 1, 2, 3, 4)]


def test_a_plan_of_low_priority_is_assigned_only_without_a_reachable_plan_of_high_priority() -> None:
    two = FlagComplex({0: [1], 1: [0, 2], 2: [1], 5: [6], 6: [5]})
    edges, gaps = [plan(2)], [plan(1), plan(6)]
    assert assigned(two, {0: 0.0, 5: 0.0}, edges, gaps) == [(5, 6), (0, 1, 2)]
    assert assigned(two, {0: 0.0}, edges, gaps) == [(0, 1, 2)]


@pytest.mark.parametrize("seed", range(8))
def test_concurrent_pushes_have_no_slot_and_no_landmark_in_common(seed: int) -> None:
    random = np.random.default_rng(seed)
    position = random.uniform(0.0, 9.0, (300, 2))
    apart = np.hypot(*(position[:, None] - position[None, :]).transpose(2, 0, 1))
    complex_ = FlagComplex({n: np.flatnonzero((row <= 1.0) & (row > 0.0)).tolist() for n, row in enumerate(apart)})
    sources = dict.fromkeys(random.choice(300, 12, replace=False).tolist(), 0.0)
    paths = assigned(complex_, sources, [plan(int(n)) for n in random.choice(300, 60, replace=False)], pushes_max=99)
    taken: set[int] = set()
    for path in paths:
        around = {*path, *(each for slot in path for each in complex_.neighbours[slot])}
        assert not around & taken
        assert path[0] in sources
        taken |= around
    assert len(paths) > 2


def test_concurrent_routines_end_with_the_last_and_wake_for_the_first() -> None:
    def story(times: list[float]):
        for at_s in times:
            yield Wake(at_s=at_s, on_packet=at_s > 2.0)
        return times

    both = run_concurrently([story([1.0, 3.0]), story([2.0]), story([])])
    assert [next(both), next(both)] == [Wake(at_s=1.0), Wake(at_s=3.0, on_packet=True)]
    with pytest.raises(StopIteration) as end:
        next(both)
    assert end.value.value == [[1.0, 3.0], [2.0], []]


# --- whole runs -----------------------------------------------------------------------------------------------------


def test_two_stations_fill_a_hall_with_pushes_at_once_and_their_swarms_become_one() -> None:
    result, single = (
        run("sensor-coverage-multi-source", runner="inline", overrides=[*HALL, NOISE, *more])
        for more in (PAPER, [*PAPER, "coordinator.parameters.pushes_max=1"])
    )
    for each in (result, single):
        assert each.outcome == "completed"
        assert each.metrics["coverage_fraction"] >= 0.99
        assert each.metrics["holes"] == 0.0
    assert result.metrics["deployment_cycles"] < 0.8 * single.metrics["deployment_cycles"]
    assert result.ticks < 0.8 * single.ticks
