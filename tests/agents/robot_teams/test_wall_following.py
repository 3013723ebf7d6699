"""Wall following by touch: the direction in which a disc goes on."""

import math

import pytest

from zwerm.agents.robot_teams.mapping.facts import BOTTOM, LEFT, RIGHT, TOP
from zwerm.agents.robot_teams.motion.manoeuvres import SliceGrid, hand_of
from zwerm.agents.robot_teams.motion.wall_following import INTO, LEFT_HAND, RIGHT_HAND, WallFollower

UP, DOWN, EAST, WEST = (0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)


def unit(degrees: float) -> tuple[float, float]:
    return math.cos(math.radians(degrees)), math.sin(math.radians(degrees))


@pytest.mark.parametrize("angle", range(0, 360, 15))
@pytest.mark.parametrize("hand", [LEFT_HAND, RIGHT_HAND])
def test_along_a_straight_wall_the_wall_stays_on_its_hand(angle: int, hand: int) -> None:
    wall, along = unit(angle), unit(angle - 90 * hand)
    follower = WallFollower(hand, along)
    vx, vy = follower.direction([wall])
    assert math.hypot(vx, vy) == pytest.approx(1.0)
    assert vx * along[0] + vy * along[1] > 0.95
    assert 0.0 < vx * wall[0] + vy * wall[1] < 0.3  # it presses, a little


def test_at_a_concave_corner_it_turns_away_from_both_walls() -> None:
    follower = WallFollower(LEFT_HAND, EAST)
    assert follower.direction([UP])[0] > 0.9
    vx, vy = follower.direction([UP, EAST])
    assert vy < -0.9
    assert follower.tangent == pytest.approx(DOWN)
    assert vx * UP[0] + vy * UP[1] <= INTO


def test_around_a_convex_corner_it_turns_with_the_contact() -> None:
    follower = WallFollower(LEFT_HAND, EAST)
    for degrees in range(90, 181, 10):
        follower.direction([unit(degrees)])
    assert follower.tangent == pytest.approx(UP)


def test_in_a_passage_as_wide_as_the_body_it_goes_on() -> None:
    follower = WallFollower(LEFT_HAND, EAST)
    assert follower.direction([UP, DOWN])[0] > 0.9
    assert follower.direction([UP, DOWN, EAST])[0] < -0.9  # a dead end: back along the other wall


def test_a_lost_wall_is_looked_for_on_its_hand() -> None:
    assert WallFollower(LEFT_HAND, EAST).direction([])[1] > 0.5
    assert WallFollower(RIGHT_HAND, EAST).direction([])[1] < -0.5


def test_another_body_is_gone_around_and_not_pressed_against() -> None:
    vx, vy = WallFollower(LEFT_HAND, EAST).direction([UP], [EAST])
    assert (vx, vy) == pytest.approx(DOWN)


@pytest.mark.parametrize(
    ("side", "direction", "hand"),
    [(TOP, RIGHT, LEFT_HAND), (TOP, LEFT, RIGHT_HAND), (BOTTOM, RIGHT, RIGHT_HAND), (BOTTOM, LEFT, LEFT_HAND)],
)
def test_the_hand_follows_from_side_and_direction(side: int, direction: int, hand: int) -> None:
    assert hand_of(side, direction) == hand


def test_the_nearest_slice_is_by_its_line() -> None:
    grid = SliceGrid(0.5, 0.95)
    assert grid.x_m(2) == pytest.approx(2.4)
    assert [grid.nearest(x) for x in (0.5, 0.97, 0.98, -0.5)] == [0, 0, 1, -1]
