"""Robots that assign themselves: the nearest one claims a frontier that opens, although nobody compares them."""

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.agents.landmark_exploration.sharing.turn_taking import (
    RETRY_TICKS,
    RETRY_TICKS_MAX,
    TICKS_PER_VERTEX,
    TurnTaking,
)

FRONTIER = 7
DELAY_TICKS = TICKS_PER_VERTEX  # until a claim is received


@settings(deadline=None)
@given(st.lists(st.integers(0, 30), min_size=1, max_size=8), st.lists(st.integers(1, 200), min_size=8, max_size=8))
def test_only_the_nearest_robots_claim_a_frontier_that_opens(vertices: list[int], idle_since: list[int]) -> None:
    robots = [TurnTaking() for _ in vertices]
    for robot, since in zip(robots, idle_since, strict=False):
        for tick in range(200 - since, 200):
            if robot.considers([], tick):
                robot.found_none(tick)
    claimed: dict[int, int] = {}  # robot: the tick of its claim
    for tick in range(200, 270):
        for number, robot in enumerate(robots):
            is_free = not any(at + DELAY_TICKS <= tick for at in claimed.values())
            if number in claimed or not robot.considers([FRONTIER] if is_free else [], tick):
                continue
            if not is_free:
                robot.found_none(tick)
            elif robot.claims(vertices[number], tick):
                claimed[number] = tick
    assert {vertices[number] for number in claimed} == {min(vertices)}


def test_a_robot_alone_claims_a_far_frontier_after_the_time_for_its_path() -> None:
    robot = TurnTaking()
    claimed_at = next(tick for tick in range(100) if robot.considers([FRONTIER], tick) and robot.claims(10, tick))
    assert claimed_at == 10 * TICKS_PER_VERTEX
    assert robot.considers([FRONTIER, 8], 101)
    assert robot.claims(0, 101)


def test_a_robot_without_a_frontier_looks_again_less_and_less_often() -> None:
    robot = TurnTaking()
    times = []
    for tick in range(1_000):
        if robot.considers([], tick):
            robot.found_none(tick)
            times.append(tick)
    steps = [after - before for before, after in pairwise(times)]
    assert steps[:2] == [RETRY_TICKS, 2 * RETRY_TICKS]
    assert set(steps[4:]) == {RETRY_TICKS_MAX}


def test_where_many_frontiers_are_free_robots_do_not_wait_for_each_other() -> None:
    robot = TurnTaking()
    assert robot.considers(None, 0)
    assert robot.claims(10, 0)
    robot.found_none(0)
    assert not robot.considers(None, 1)
    assert not robot.considers([FRONTIER], 2)
    assert not robot.considers([FRONTIER], 3)
    assert robot.considers([FRONTIER, 8], 4)
