"""Walks along walls that go at once: they begin far apart, and do not count where walking robots see each other."""

from collections.abc import Sequence

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.frontier.attempt_log import AttemptLog
from zwerm.agents.sensor_coverage.frontier.paths import CheapestRoutes, Dijkstra
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import Sighting, Waypoint
from zwerm.coordinator.sensor_coverage.assignment import APART_EDGES, SLOTS_PER_WALK, WALKS_MAX, CheapestFirst, within
from zwerm.coordinator.sensor_coverage.coordinator import SensorCoverageCoordinator
from zwerm.coordinator.sensor_coverage.wall_walks import before_meeting
from zwerm.deploy.node_specs import node_specs
from zwerm.maths.simplicial import FlagComplex
from zwerm.scenario.load import load

# A file of robots from a station (0), from whose middle (20) another one branches off: 41 to 60.
MIDDLE = 20
FORK = FlagComplex(
    {n: [each for each in (n - 1, n + 1) if 0 <= each <= 40] for n in range(41)}
    | {n: [n - 1 if n > 41 else MIDDLE, *([n + 1] if n < 60 else [])] for n in range(41, 61)}
    | {MIDDLE: [MIDDLE - 1, MIDDLE + 1, 41]}
)


def walk(mover: int, meet: tuple[int, ...] = ()) -> Plan:
    """Return a plan to follow a wall from a slot."""
    return Plan((mover, mover, 0, 1000), mover, 0.0, 0.95, 0.0, (mover,), walk=True, meet=meet)


def plans_of(
    plans: Sequence[Plan], sources: dict[int, float], slots: Slots | None = None, complex_: FlagComplex = FORK
) -> tuple[Plan, ...]:
    def routes(part: FlagComplex, starts: dict[int, float]) -> CheapestRoutes:
        return Dijkstra(3.0).routes(part, starts, ())

    service = CheapestFirst(slots or Slots(), 9, AttemptLog(1, 0.3))
    return service.assign([plans], ScanResult({}, complex_, (0,)), sources, routes)  # type: ignore[arg-type]


def assigned(plans: Sequence[Plan], sources: dict[int, float], slots: Slots | None = None) -> list[tuple[int, ...]]:
    return [each.path for each in plans_of(plans, sources, slots)]


def test_walks_at_the_ends_of_two_files_go_at_once() -> None:
    assert assigned([walk(40), walk(60)], {0: 0.0, 59: -100.0}) == [tuple(range(41)), (59, 60)]


def test_a_station_releases_one_robot_for_each_60_slots() -> None:
    """One may close all that is open."""
    assert len(FORK.vertices) == SLOTS_PER_WALK + 1
    assert assigned([walk(40), walk(60)], {0: 0.0}) == [tuple(range(41))]
    larger = FlagComplex({**FORK.neighbours, **dict.fromkeys(range(61, 2 * SLOTS_PER_WALK), ())})
    assert [each.mover for each in plans_of([walk(40), walk(60)], {0: 0.0}, complex_=larger)] == [60, 40]


@pytest.mark.parametrize(("other", "count"), [(APART_EDGES, 1), (APART_EDGES + 1, 2)])
def test_walks_that_begin_close_to_each_other_go_one_after_the_other(other: int, count: int) -> None:
    assert len(assigned([walk(40), walk(40 - other)], {0: 0.0, 39: -100.0})) == count


def test_robots_set_out_at_the_same_time_where_their_paths_do_not_cross() -> None:
    def waiting(sources: dict[int, float]) -> list[tuple[int, bool]]:
        return [(each.mover, each.waits) for each in plans_of([walk(MIDDLE), walk(40), walk(60)], sources)]

    assert waiting({0: 0.0, 59: -100.0, 39: -100.0}) == [(MIDDLE, False), (60, False), (40, False)]
    assert waiting({0: 0.0, 21: -100.0, 39: -100.0}) == [(60, False), (40, False), (MIDDLE, True)]


def test_the_robot_with_the_longest_way_sets_out_first_so_that_nobody_waits_beside_its_way() -> None:
    assert [each[-1] for each in assigned([walk(MIDDLE), walk(40)], {0: 0.0, MIDDLE - 1: -100.0})] == [40, MIDDLE]


def test_no_robot_sets_out_past_one_that_has_set_out_before() -> None:
    slots = Slots()
    for robot in FORK.vertices:
        slots.add(robot)
    sources = {0: 0.0, 59: -100.0}
    assert len(assigned([walk(40), walk(60)], sources, slots)) == 2
    slots.remember(40, 59, 0.0)
    assert len(assigned([walk(40), walk(60)], sources, slots)) == 1, "the robot at 40 would wait beside it"


def test_the_robot_of_a_redundant_slot_sets_out_once() -> None:
    assert assigned([walk(40), walk(30)], {35: -100.0}) == [tuple(range(35, 29, -1))]


def test_a_walk_to_another_part_of_the_swarm_goes_alone() -> None:
    assert len(assigned([walk(40, meet=(7,)), walk(60)], {40: 0.0, 0: 0.0})) == 1
    assert len(assigned([walk(60), walk(40, meet=(7,))], {60: 0.0, 0: 0.0})) == 1


def test_the_number_of_walks_that_go_at_once_is_bounded() -> None:
    long = FlagComplex({n: [each for each in (n - 1, n + 1) if 0 <= each < 200] for n in range(200)})
    movers = range(5, 200, APART_EDGES + 3)
    sources = dict.fromkeys((each - 1 for each in movers), -100.0)
    found = plans_of([walk(each) for each in movers], sources, complex_=long)
    assert len(found) == WALKS_MAX
    assert all(b.mover not in within(long, a.mover, APART_EDGES) for a in found for b in found if a != b)


def test_robots_behind_another_walk_do_not_stand_still_meanwhile() -> None:
    """Where they are seen, while they drive to other slots, is not the place of a slot."""
    coordinator = Node(*node_specs(load("sensor-coverage", ("robots.count=3",)), 1)[3])._controller
    assert isinstance(coordinator, SensorCoverageCoordinator)
    walking, slots = coordinator.walking, coordinator.slots
    for robot in range(100, 106):
        slots.add(robot)
    here, there = walk(2)._replace(path=(1, 2)), walk(4)._replace(path=(3, 4))
    assert walking._still(here, [here]) == set(slots.occupant.values())
    assert walking._still(here, [here, there]) == set(slots.occupant.values()) - {slots.occupant[3], slots.occupant[4]}
    walking._walking[slots.occupant[5]] = None
    assert slots.occupant[5] not in walking._still(here, [here])


def test_a_way_counts_up_to_where_another_walking_robot_was_in_sight() -> None:
    way = [Waypoint(0.1 * each, 0.0, (Sighting(1, 0.0),), (), ()) for each in range(5)]
    sees = Waypoint(0.5, 0.0, (Sighting(1, 0.0), Sighting(7, 1.0)), (), ())
    touches = Waypoint(0.5, 0.0, (Sighting(1, 0.0),), (), (7,))
    for meets in (sees, touches):
        assert before_meeting([*way, meets, *way], [7, 8]) == way
        assert before_meeting([*way, meets, *way], [8]) == [*way, meets, *way]
