"""The stays of robots at slots: one that leaves and comes back may stand elsewhere."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.stays import Pushed, Stays


def test_a_robot_that_leaves_its_slot_and_comes_back_begins_another_stay() -> None:
    stays = Stays(0.1)
    first = stays.number(3, 7)
    assert stays.number(3, 7) == first
    assert stays.number(4, 7) != first
    assert stays.number(3, 8) != first
    assert stays.number(3, 7) not in (first, stays.number(4, 7))


def test_what_a_robot_touches_is_kept_by_stays() -> None:
    slots = Slots()
    slot = slots.add(7)
    slots.touch(slot, [1.0])
    slots.touch(slot, [1.5])
    for robot, touched in ((8, [2.0]), (7, [3.0])):
        slots.occupant[slot] = robot
        slots.touch(slot, touched)
    assert list(slots.touched_by.values()) == [[1.5], [2.0], [3.0]]


@pytest.mark.parametrize(
    ("ways", "pushed"),
    [
        pytest.param([(0.02, 0.0), (-0.02, 0.0), (0.02, 0.0)], Pushed.NOT, id="to and fro"),
        pytest.param([(0.02, 0.0), (0.0, 0.025)], Pushed.NEAR, id="again and again"),
        pytest.param([(0.12, 0.0)], Pushed.FAR, id="far"),
    ],
)
def test_a_stay_ends_where_others_push_the_robot_off_its_place(ways: list[tuple[float, float]], pushed: Pushed) -> None:
    stays = Stays(0.1)
    stay = stays.number(3, 7)
    found = [stays.push(3, 7, way) for way in ways]
    assert found == [Pushed.NOT] * (len(ways) - 1) + [pushed]
    assert (stays.number(3, 7) == stay) is (pushed is Pushed.NOT)


def test_two_stays_are_as_far_apart_as_robots_show_that_both_saw_at_the_same_places() -> None:
    stays = Stays(0.1)
    one = stays.number(3, 7)
    for other in (4, 5, 6):
        stays.see(3, other, {3: 7, other: 10 + other}, 1.0)
    stays.see(3, 4, {3: 8, 4: 14}, 1.1)
    stays.see(3, 5, {3: 8, 5: 20}, 2.0)
    stays.see(3, 6, {3: 8, 6: 16}, 0.8)
    two = stays.number(3, 8)
    distances = {4: 0.5, 5: 0.5, 6: math.inf}
    assert stays.apart_m(one, two, distances.__getitem__) == pytest.approx(0.5 * math.sin(0.1))
    assert stays.apart_m(one, 99, distances.__getitem__) == 0.0
