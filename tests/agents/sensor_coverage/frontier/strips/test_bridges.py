"""A walking robot goes round a standing one: whether it followed one wall, also behind that robot.

The wall is in the south, at y = 0. The walking robot goes east, and around the standing one on its north side. A slot in the
north sees both.
"""

import math
from collections.abc import Mapping, Sequence

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.strips.bridges import bridged
from zwerm.agents.sensor_coverage.frontier.strips.stretches import stretches_of
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, Walk, WalkPoint, overlap
from zwerm.maths.simplicial import FlagComplex

RADIUS_M = 0.07
STANDING, NORTH = 3, 5
STAY = 8
SOUTH = -math.pi / 2.0
IN_TOUCH = {(STANDING, STAY): (SOUTH,)}


def walk_past(y_m: float = RADIUS_M, at_body: bool = False) -> Walk:
    """Return the walk past a robot at (0, y)."""
    half_rad = math.acos((RADIUS_M - y_m) / (2.0 * RADIUS_M))
    turn = [SOUTH - half_rad - each * (math.tau - 2.0 * half_rad) / 10.0 for each in range(11)]
    around = [(2.0 * RADIUS_M * math.cos(each), y_m + 2.0 * RADIUS_M * math.sin(each)) for each in turn]
    x_m = around[-1][0]
    before = [(-x_m - 0.05 * each, RADIUS_M) for each in range(8, 0, -1)]
    after = [(x_m + 0.05 * each, RADIUS_M) for each in range(1, 9)]
    points = list[WalkPoint]()
    for x, y in (*before, *around, *after):
        is_beside, is_at_wall = (x, y) in around, y < RADIUS_M + 0.002
        seen = {STANDING: math.atan2(y - y_m, x), NORTH: math.atan2(y - 0.6, x)}
        robots = (STANDING,) if is_beside else ()
        points.append(WalkPoint(seen, (SOUTH,) if is_at_wall else (), robots, at_body and is_beside, at=(x, y)))
    return Walk(0, -1, tuple(points), RADIUS_M, stays={STANDING: STAY})


def stretches(walk: Walk, touched_by: Mapping[tuple[int, int], Sequence[float]]) -> int:
    """Return the number of the stretches of wall of a walk."""
    return len({each.first_number for each in stretches_of(bridged(walk, touched_by).walk).values()})


def test_a_wall_goes_on_behind_a_robot_that_touches_it() -> None:
    assert bridged(walk_past(), IN_TOUCH).robots == (STANDING,)
    assert stretches(walk_past(), IN_TOUCH) == 1


@pytest.mark.parametrize(
    ("walk", "touched_by"),
    [
        pytest.param(walk_past(), {}, id="the robot touches nothing"),
        pytest.param(walk_past(), {(STANDING, STAY): (math.pi / 2.0,)}, id="it touches a wall on the other side"),
        pytest.param(walk_past(), {(STANDING, STAY + 1): (SOUTH,)}, id="it touched the wall in another stay"),
        pytest.param(walk_past(0.16), IN_TOUCH, id="it stands off the wall, at another one"),
        pytest.param(walk_past(at_body=True), IN_TOUCH, id="a dead body is in touch, too"),
    ],
)
def test_a_wall_may_end_behind_a_robot(walk: Walk, touched_by: Mapping[tuple[int, int], Sequence[float]]) -> None:
    assert bridged(walk, touched_by).walk is walk
    assert stretches(walk, touched_by) == 2


def test_a_corner_before_a_robot_is_one_wall_although_that_touches_nothing() -> None:
    """The robot fills the mouth of a door. The walking robot touches it, and then the jamb in front of it."""
    mouth = 0.0, 0.07  # the jamb ends at (-0.1, 0)
    way = [
        ((-0.2, 0.07), (SOUTH,), ()),
        ((-0.12, 0.07), (SOUTH,), ()),
        ((-0.1, 0.1), (), (STANDING,)),
        ((-0.11, 0.07), (math.radians(-70.0),), (STANDING,)),
    ]
    points = [
        WalkPoint({STANDING: math.atan2(y - mouth[1], x)}, walls, robots, at=(x, y)) for (x, y), walls, robots in way
    ]
    walk = Walk(0, -1, tuple(points), RADIUS_M, stays={STANDING: STAY})
    assert stretches(walk, {}) == 1
    assert stretches(walk._replace(points=(*points[:3], points[3]._replace(at=(0.11, 0.07)))), {}) == 2


def test_a_wall_behind_a_robot_is_closed_without_a_triangle_with_it() -> None:
    """At its slot stands another one now, which the slot in the north does not see."""
    views: Mapping[int, Mapping[int, float]] = {STANDING: {}, NORTH: {}}
    scan = ScanResult(views, FlagComplex(views), ())
    for touched_by, is_closed in ((IN_TOUCH, True), ({}, False)):
        proof = SwarmProof()
        proof.update(scan, [walk_past()], {}, {}, {}, {STANDING: STAY}, touched_by)
        behind = Arc(SOUTH - math.radians(8.0), math.radians(16.0))
        opened = sum(overlap(each, behind) for each in proof.open_arcs()[NORTH])
        assert (opened == 0.0) is is_closed
