"""The lead's decisions: the barrier, room in a corridor, reservations and division."""

import msgspec
import pytest

from zwerm.agents.robot_teams.mapping.facts import RIGHT, TOP, End, SweptSegment, TracedArc
from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.planning import (
    LINK,
    Task,
    assign,
    division,
    finder,
    free_members,
    latest_plans,
    open_tasks,
    reservation,
    room,
)
from zwerm.agents.robot_teams.protocols.team_messages import HUNTS, READY, CorridorPlan, Status, View

VIEW = View(2, 0, (0, 1, 2, 3))
CORNER = End(0, TOP, 5_000)


def status(node: int, number: int, phase: int = READY, at: End | None = CORNER, found: bool = False) -> Status:
    return Status(node, 1, 0, 0, VIEW.epoch, number, phase, at, found, False, None, None, None, (VIEW.epoch, VIEW.lead))


def plan(number: int, order: tuple[int, ...], epoch: int = 2) -> CorridorPlan:
    return CorridorPlan(epoch, number, CORNER, RIGHT, False, order)


def swept(*slices: int) -> SliceMap:
    slice_map = SliceMap()
    slice_map.merge([SweptSegment(k, 0, 5_000) for k in slices])
    for k in slices[:-1]:
        slice_map.add(TracedArc(End(k, TOP, 5_000), RIGHT, End(k + 1, TOP, 5_000), 950, 0, 0))
    return slice_map


def test_the_barrier_is_passed_by_robots_that_finished_their_latest_plan() -> None:
    plans = [plan(1, (0, 1)), plan(2, (1, 2))]
    statuses = {0: status(0, 1), 1: status(1, 1), 2: status(2, 2, HUNTS), 3: status(3, 0)}
    assert free_members(VIEW, plans, statuses) == [0, 3]
    assert latest_plans(plans, VIEW)[1].number == 2


def test_plans_and_statuses_of_another_view_count_for_nothing() -> None:
    old = status(0, 5)
    statuses = {0: msgspec.structs.replace(old, epoch=1)}
    assert free_members(VIEW, [plan(5, (0,), epoch=1)], statuses) == []


def test_a_corridor_has_room_until_a_swept_slice() -> None:
    slice_map = swept(0, 3)
    task = Task(CORNER, RIGHT, False)
    assert room(slice_map, task, 4) == 2
    assert room(slice_map, Task(End(3, TOP, 5_000), RIGHT, False), 4) == 4


def test_everything_open_is_a_task() -> None:
    slice_map = swept(0, 1)
    tasks = open_tasks(slice_map)
    assert Task(End(1, TOP, 5_000), RIGHT, False) in tasks
    assert Task(CORNER, RIGHT, False) not in tasks
    assert len(tasks) == len(slice_map.certificate.open_ports)


def test_free_robots_form_one_corridor_where_there_is_room() -> None:
    statuses = {node: status(node, 0, at=End(1, TOP, 5_000)) for node in VIEW.members}
    made = assign(swept(0, 1), VIEW, (), (), statuses, (), False, 6_000)
    assert len(made[0].order) == 4
    assert made[0].anchor.slice in (0, 1)


@pytest.mark.parametrize("ahead", [0, 1])
def test_of_robots_at_one_end_the_one_ahead_goes_first(ahead: int) -> None:
    there = End(1, TOP, 5_000)
    x_mm = {node: 1_500 if node == ahead else 900 for node in (0, 1)}
    statuses = {node: msgspec.structs.replace(status(node, 0, at=there), x_mm=x_mm[node]) for node in (0, 1)}
    first, *_ = assign(swept(0, 1), View(2, 0, (0, 1)), (), (), statuses, (), False, 6_000)
    assert (first.anchor, first.direction) == (there, RIGHT)
    assert first.order == (1 - ahead, ahead), "the lead of a corridor is the last in its order"


def test_a_reserved_cell_is_left_to_the_robots_that_work_in_it() -> None:
    slice_map = swept(0, 1)
    busy = CorridorPlan(2, 1, End(1, TOP, 5_000), RIGHT, False, (1, 2, 3))
    statuses = {node: status(node, 1, HUNTS, End(1, TOP, 5_000)) for node in (1, 2, 3)}
    statuses[0] = status(0, 0, at=End(1, TOP, 5_000))
    assert reservation(slice_map, busy).holds(Task(End(1, TOP, 5_000), RIGHT, False))
    made = assign(slice_map, VIEW, (busy,), (busy,), statuses, (), False, 60_000)
    assert all(each.order == (0,) for each in made)
    assert all(not reservation(slice_map, busy).holds(Task(e.anchor, e.direction, e.own_slice)) for e in made)


def test_robots_that_began_apart_join_their_maps_first() -> None:
    statuses = {0: status(0, 0), 1: status(1, 0, at=End(1, TOP, 5_000))}
    made = assign(swept(0, 1), View(2, 0, (0, 1)), (), (), statuses, (), False, 6_000)
    assert LINK not in [each.anchor.side for each in made]
    statuses[1] = status(1, 0, at=End(7, TOP, 5_000))
    apart = SliceMap()
    apart.merge([SweptSegment(0, 0, 5_000), SweptSegment(7, 0, 5_000)])
    made = assign(apart, View(2, 0, (0, 1)), (), (), statuses, (), False, 6_000)
    assert [each.anchor.side for each in made] == [LINK]


def test_the_finder_and_those_behind_it_take_the_new_cell() -> None:
    statuses = {node: status(node, 1, found=node == 1) for node in VIEW.members}
    order = (3, 1, 0, 2)
    assert finder(order, statuses) == 1
    assert division(VIEW, order, 1) == ((3, 1), (0, 2))


def test_a_lead_that_finds_a_cell_splits_the_formation_in_half() -> None:
    assert division(VIEW, (0, 1, 2, 3), 3) == ((0, 1), (2, 3))
    assert division(View(2, 0, (0,)), (0,), 0) is None


def test_no_robot_found_anything() -> None:
    assert finder((0, 1), {0: status(0, 1), 1: status(1, 1)}) is None
