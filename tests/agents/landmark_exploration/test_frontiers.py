"""Frontier rules, on the configurations of the paper's figures and on every status."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zwerm.agents.landmark_exploration.mapping.bearing_steps import (
    STEPS,
    BearingSnapshot,
    is_inside,
    is_left,
    to_rad,
    to_steps,
)
from zwerm.agents.landmark_exploration.mapping.boundary_trace import inconsistent
from zwerm.agents.landmark_exploration.mapping.frontier_status import (
    BOUNDARY,
    CLEAR,
    REOPENED,
    TIMED_OUT,
    UNEXPLORED,
    UNKNOWN,
    Frontiers,
    key_of,
    pair_of,
)

# Fig. 4: landmark 1 at the left, 2 and 3 one above the other at the right; <2, 3> lies beyond them.
TRIANGLE = {1: (0.0, 0.0), 2: (1.0, -0.5), 3: (1.0, 0.5)}


def seen_from(x: float, y: float, landmarks: dict[int, tuple[float, float]]) -> BearingSnapshot:
    ids = tuple(sorted(landmarks))
    bearings = [math.atan2(landmarks[each][1] - y, landmarks[each][0] - x) for each in ids]
    return BearingSnapshot(ids, tuple(map(to_steps, bearings)))


def test_outside_the_hull_no_frontier_is_cleared() -> None:
    frontiers = Frontiers()
    assert frontiers.note(seen_from(1.4, 0.0, TRIANGLE))
    assert set(frontiers.statuses.values()) == {UNEXPLORED}
    assert len(frontiers.open) == 6


def test_inside_the_hull_the_half_that_the_robot_is_in_is_cleared() -> None:
    frontiers = Frontiers()
    frontiers.note(seen_from(1.4, 0.0, TRIANGLE))
    frontiers.note(seen_from(0.7, 0.0, TRIANGLE))
    assert {pair_of(key) for key in frontiers.with_status(CLEAR)} == {(1, 2), (2, 3), (3, 1)}
    assert {pair_of(key) for key in frontiers.open} == {(2, 1), (3, 2), (1, 3)}


def test_a_robot_left_of_the_line_from_a_to_b_knows_it_by_the_relative_bearing() -> None:
    a, b = (0.0, 0.0), (1.0, 0.0)
    for y, left in ((0.5, True), (-0.5, False)):
        bearing_a, bearing_b = seen_from(0.3, y, {1: a, 2: b}).bearings
        assert is_left(bearing_a, bearing_b) is left


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_landmarks_clear_nothing(count: int) -> None:
    frontiers = Frontiers()
    frontiers.note(BearingSnapshot(tuple(range(count)), tuple(range(0, 90 * count, 90))))
    assert CLEAR not in frontiers.statuses.values()
    assert len(frontiers.open) == count * (count - 1)


def test_landmarks_in_line_with_the_observer_are_on_neither_side() -> None:
    frontiers = Frontiers()
    frontiers.note(BearingSnapshot((1, 2, 3, 4), (0, 0, 100, 180)))  # 1 and 2 behind each other, or at one place
    assert frontiers.status(1, 2) == frontiers.status(2, 1) == UNEXPLORED
    assert frontiers.status(1, 3) == CLEAR
    opposite = Frontiers()
    opposite.note(BearingSnapshot((1, 2, 3), (0, STEPS // 2, 50)))
    assert set(opposite.statuses.values()) == {UNEXPLORED}


def test_a_clear_frontier_keeps_this_status() -> None:
    frontiers = Frontiers()
    assert frontiers.raise_to(key_of(1, 2), CLEAR)
    assert not frontiers.raise_to(key_of(1, 2), BOUNDARY)
    assert not frontiers.note(BearingSnapshot((1, 2), (0, 200))) or frontiers.status(1, 2) == CLEAR
    assert not frontiers.is_open(1, 2)


def test_a_reopened_frontier_is_open_again_and_counts_at_both_landmarks() -> None:
    frontiers = Frontiers()
    key = key_of(7, 9)
    for status, is_open in ((UNEXPLORED, True), (TIMED_OUT, False), (REOPENED, True), (BOUNDARY, False)):
        frontiers.raise_to(key, status)
        assert frontiers.is_open(7, 9) is is_open
        assert [frontiers.open_at(landmark) for landmark in (7, 9)] == [is_open, is_open]


def test_utility_counts_each_frontier_that_shares_a_landmark_once() -> None:
    frontiers = Frontiers()
    for pair in ((1, 2), (2, 1), (2, 3), (4, 1), (5, 6)):
        frontiers.raise_to(key_of(*pair), UNEXPLORED)
    assert frontiers.sharing(key_of(1, 2)) == 4
    assert frontiers.sharing(key_of(5, 6)) == 1


def crossed(landmarks: list[tuple[float, float]], a: int, b: int, along: float) -> Frontiers:
    """Return the frontiers after one step of 0.05 r over the line between two landmarks, at a fraction of its length."""
    (ax, ay), (bx, by) = landmarks[a], landmarks[b]
    length = math.hypot(bx - ax, by - ay)
    x = ax + along * (bx - ax) - 0.05 * (by - ay) / length
    y = ay + along * (by - ay) + 0.05 * (bx - ax) / length
    near = {n: each for n, each in enumerate(landmarks) if math.hypot(each[0] - x, each[1] - y) <= 1.0}
    frontiers = Frontiers()
    frontiers.note(seen_from(x, y, near))
    return frontiers


@pytest.mark.parametrize("along", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_with_the_landmarks_of_figure_6a_one_step_over_a_line_clears_its_frontier(along: float) -> None:
    """Landmarks on a triangular lattice of side r: from everywhere on a line the landmark behind it is visible."""
    lattice = [(x + 0.5 * y, 0.5 * math.sqrt(3.0) * y) for y in range(3) for x in range(3)]
    frontiers = crossed(lattice, 0, 1, along)
    assert frontiers.status(0, 1) == CLEAR
    assert frontiers.status(1, 0) == UNEXPLORED


def test_with_the_landmarks_of_figure_6c_one_step_over_a_line_clears_nothing() -> None:
    """Lines of landmarks that are farther apart than r: on one line no landmark of the next one is visible."""
    lines = [(0.3 * x, 1.1 * y) for y in range(2) for x in range(6)]
    frontiers = crossed(lines, 2, 3, 0.5)
    assert CLEAR not in frontiers.statuses.values()
    assert frontiers.is_open(2, 3)


snapshots = st.lists(st.tuples(st.integers(0, 8), st.integers(0, STEPS - 1)), max_size=7).map(
    lambda pairs: BearingSnapshot(tuple(sorted(dict(pairs))), tuple(dict(pairs)[key] for key in sorted(dict(pairs))))
)


@given(st.lists(snapshots, max_size=6), st.randoms())
def test_statuses_do_not_depend_on_the_order_of_observations(some: list[BearingSnapshot], random: object) -> None:
    one, other = Frontiers(), Frontiers()
    shuffled = [*some, *some]
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    for each in some:
        one.note(each)
    for each in shuffled:
        other.note(each)
    assert one.statuses == other.statuses
    assert one.open_of.keys() >= {each for key in one.open for each in pair_of(key)}
    assert sorted(one.open) == sorted(other.open) == sorted(k for k, s in one.statuses.items() if s == UNEXPLORED)


@given(snapshots)
def test_inside_means_that_no_half_plane_holds_all_landmarks(snapshot: BearingSnapshot) -> None:
    angles = [to_rad(each) for each in snapshot.bearings]
    # A direction to whose left no landmark is: all lie in one closed half plane through the observer.
    empty = any(
        all(math.sin(each - (edge + shift)) <= 1e-9 for each in angles) for edge in angles for shift in (0.0, math.pi)
    )
    assert is_inside(snapshot.bearings) is (len(angles) >= 3 and not empty)


def test_a_boundary_that_can_be_traced_on_is_consistent() -> None:
    frontiers = Frontiers()
    for pair, status in {(1, 2): BOUNDARY, (2, 3): TIMED_OUT, (3, 1): BOUNDARY}.items():
        frontiers.raise_to(key_of(*pair), status)
    assert inconsistent(frontiers) == []


def test_a_boundary_that_ends_is_inconsistent() -> None:
    frontiers = Frontiers()
    for pair, status in {(1, 2): BOUNDARY, (2, 3): TIMED_OUT, (5, 6): TIMED_OUT, (6, 5): TIMED_OUT}.items():
        frontiers.raise_to(key_of(*pair), status)
    assert [pair_of(key) for key in inconsistent(frontiers)] == [(2, 3), (5, 6), (6, 5)]


def test_an_unknown_frontier_has_no_status() -> None:
    assert Frontiers().status(1, 2) == UNKNOWN
