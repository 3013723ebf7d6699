"""The controllers of Voronoi coverage: one observation in, one command out, for every observation."""

import math
from typing import Any

import msgspec
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.agents.runtime.contract import Body, Setup
from zwerm.agents.runtime.controllers import make
from zwerm.agents.voronoi_coverage.quadratic import Curvature, NeighbourSample, bordering, fit, quadratic_centroid
from zwerm.agents.voronoi_coverage.radio import CHANNEL, NeighbourReport, pack, unpack
from zwerm.agents.voronoi_coverage.swarmbot import SwarmBotTable, closed_cell
from zwerm.maths.polygons import linear_centroid, voronoi_cell
from zwerm.wire.messages import FieldSample, Neighbour, Observation, Packet, Pose
from zwerm.world.geometry.quadrature import integrate

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
FIELDS = st.floats(-1e3, 1e3)
PLACES = st.tuples(st.floats(-2.0, 3.0), st.floats(-2.0, 3.0))


def controller(name, node=0, dt_s=0.1, **parameters):
    body = Body(kind="holonomic", radius_m=0.001, max_speed_m_s=10.0, max_turn_rad_s=6.0)
    return make(name, Setup(node, "robot", dt_s, (), bytes(16), body, ("robots",), parameters))


def observe(here, others, value=1.0, gradient=(0.0, 0.0), heading=0.0, region=SQUARE, inbox=(), tick=0, dt_s=0.1):
    """Return what a robot at `here` observes: everything turned into its body frame."""
    cos, sin = math.cos(heading), math.sin(heading)

    def into_body(x, y):
        return cos * x + sin * y, cos * y - sin * x

    def seen(place):
        return into_body(place[0] - here[0], place[1] - here[1])

    return Observation(
        tick,
        tick * dt_s,
        inbox,
        neighbours=tuple(Neighbour(node, *seen(other)) for node, other in enumerate(others, 1)),
        boundary=tuple(seen(corner) for corner in region),
        field=FieldSample(value, *into_body(*gradient)),
        pose=Pose(here[0], here[1], heading),
    )


def velocity(command):
    return command.drive.forward_m_s, command.drive.left_m_s


# --- the algorithm as printed ---------------------------------------------------------------------------------------


def test_a_robot_moves_towards_the_centroid_of_its_cell_at_k_times_the_distance():
    # Half the square, left of x = 0.5, is its cell.
    found = velocity(controller("voronoi-coverage").step(observe((0.2, 0.5), [(0.8, 0.5)])))
    assert found == (pytest.approx(5.0 * (0.25 - 0.2)), pytest.approx(0.0))


@settings(max_examples=50, deadline=None)
@given(st.lists(PLACES, max_size=12), st.floats(-math.pi, math.pi), FIELDS, FIELDS, FIELDS)
def test_a_robot_that_is_turned_moves_the_same_way_in_the_room(others, heading, value, gx, gy):
    step = controller("voronoi-coverage").step
    straight = velocity(step(observe((0.4, 0.6), others, value, (gx, gy))))
    forward, left = velocity(step(observe((0.4, 0.6), others, value, (gx, gy), heading)))
    cos, sin = math.cos(heading), math.sin(heading)
    turned = (cos * forward - sin * left, sin * forward + cos * left)
    # A field that is negative nearly everywhere leaves a V+ so small that rounding decides what is left of it.
    if value > 1.5 * math.hypot(gx, gy) or (value > 0.0 and gx == gy == 0.0):
        assert turned == pytest.approx(straight, abs=1e-6)


@settings(max_examples=200, deadline=None)
@given(
    PLACES, st.lists(PLACES, max_size=12), FIELDS, FIELDS, FIELDS, st.sampled_from(["coverage", "integer", "swarmbot"])
)
def test_every_observation_gives_a_finite_command_that_leads_into_the_region(here, others, value, gx, gy, kind):
    found = velocity(controller(f"voronoi-{kind}").step(observe(here, [*others, here], value, (gx, gy))))
    assert all(map(math.isfinite, found))
    if kind == "coverage":
        place = here[0] + found[0] / 5.0, here[1] + found[1] / 5.0
        assert shapely.box(0, 0, 1, 1).distance(shapely.Point(place)) < 1e-6


def test_a_robot_outside_the_region_whose_cell_is_empty_heads_for_its_nearest_place():
    found = velocity(controller("voronoi-coverage").step(observe((3.0, 0.5), [(0.5, 0.5)])))
    assert found == (pytest.approx(-10.0), pytest.approx(0.0))


def test_robots_at_one_place_move_as_one():
    step = controller("voronoi-coverage").step
    assert step(observe((0.2, 0.5), [(0.8, 0.5), (0.2, 0.5)])) == step(observe((0.2, 0.5), [(0.8, 0.5)]))


def test_a_robot_is_done_while_its_error_is_below_the_tolerance():
    done = controller("voronoi-coverage", tolerance_m=1e-3)
    assert done.step(observe((0.5, 0.5 + 0.9e-3), [])).done
    assert not done.step(observe((0.5, 0.5 + 1.1e-3), [])).done
    assert not controller("voronoi-coverage").step(observe((0.5, 0.5), [])).done


# --- as the SwarmBots ran it ----------------------------------------------------------------------------------------


def test_a_robot_that_loses_all_neighbours_stays_until_it_has_one_again():
    robot = controller("voronoi-swarmbot")
    assert velocity(robot.step(observe((0.5, 0.5), [(0.6, 0.5)], 1.0, (3.0, 0.0)))) != (0.0, 0.0)
    assert velocity(robot.step(observe((0.5, 0.5), [], 1.0, (3.0, 0.0)))) == (0.0, 0.0)
    assert velocity(robot.step(observe((0.5, 0.5), [(0.6, 0.5)], 1.0, (3.0, 0.0)))) != (0.0, 0.0)


@settings(max_examples=50, deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(0.01, 1.0))
def test_one_neighbour_closes_the_cell_with_a_triangle_on_the_bisector(angle, distance):
    table = SwarmBotTable(triangle_base_m=0.4, triangle_height_m=0.9)
    n = np.array([math.cos(angle), math.sin(angle)])
    triangle = np.array(closed_cell([tuple(distance * n), tuple(2 * distance * n)], table))
    assert shapely.Polygon(triangle).exterior.is_ccw
    assert shapely.Polygon(triangle).area == pytest.approx(0.4 * 0.9 / 2)
    assert sorted(triangle @ n) == pytest.approx(sorted([distance / 2, distance / 2, distance / 2 - 0.9]))


def test_a_gap_of_half_a_turn_is_closed_by_a_line_across_its_middle():
    table = SwarmBotTable(line_m=0.3, horizon_m=5.0)
    cell = np.array(closed_cell([(0.2, 0.2), (-0.2, 0.2)], table))
    assert cell[:, 1].min() == pytest.approx(-0.3)
    assert np.abs(cell[:, 0]).max() == pytest.approx(0.5)  # where the bisectors meet the line
    corridor = np.array(closed_cell([(0.2, 0.0), (-0.2, 0.0)], table))
    assert sorted(map(tuple, corridor.round(9))) == [(-0.1, -0.3), (-0.1, 0.3), (0.1, -0.3), (0.1, 0.3)]


def test_a_robot_at_the_same_place_is_no_neighbour():
    table = SwarmBotTable()
    assert closed_cell([(0.0, 0.0)], table) == []
    assert closed_cell([(0.0, 0.0), (-0.2, 0.1)], table) == closed_cell([(-0.2, 0.1)], table)


def test_a_cell_that_neighbours_bound_is_not_changed():
    others = [(0.2, 0.0), (0.0, 0.2), (-0.2, 0.0), (0.0, -0.2)]
    assert shapely.Polygon(closed_cell(others, SwarmBotTable(line_m=0.01))).area == pytest.approx(0.04)


def test_only_the_direction_of_the_light_counts_and_the_offset_moderates_it():
    ring = [(0.7, 0.5), (0.5, 0.7), (0.3, 0.5), (0.5, 0.3)]

    def forward(offset, slope):
        robot = controller("voronoi-swarmbot", offset=offset, gradient_magnitude=500.0)
        return robot.step(observe((0.5, 0.5), ring, 10.0, (slope, 0.0))).drive.forward_m_s

    assert forward(800.0, 1.0) == pytest.approx(forward(800.0, 300.0))
    assert forward(10.0, 1.0) > forward(100.0, 1.0) > forward(800.0, 1.0) > 0.0
    assert forward(10.0, 0.0) == pytest.approx(0.0)


def test_within_the_threshold_and_as_a_beacon_a_robot_stays():
    observation = observe((0.5, 0.5), [(0.8, 0.5), (0.5, 0.8), (0.3, 0.5), (0.5, 0.3)])
    assert velocity(controller("voronoi-swarmbot").step(observation)) != (0.0, 0.0)
    assert velocity(controller("voronoi-swarmbot", threshold_m=0.1).step(observation)) == (0.0, 0.0)
    beacon = controller("voronoi-swarmbot", node=3, beacons=4).step(observation)
    assert velocity(beacon) == (0.0, 0.0)
    assert beacon.wake is not None


# --- over a radio ---------------------------------------------------------------------------------------------------


def received(node, time_s, place, value=1.0):
    return Packet(CHANNEL, pack(node, NeighbourReport(time_s, place[0], place[1], value)))


def test_neighbours_known_by_radio_give_the_command_of_sensed_neighbours():
    others = [(0.8, 0.5), (0.1, 0.9), (0.4, 0.2)]
    sensed = controller("voronoi-coverage").step(observe((0.3, 0.5), others, 1.0, (0.5, 0.2), 0.7))
    inbox = tuple(received(node, 0.0, place) for node, place in enumerate(others, 1))
    told = controller("voronoi-radio").step(observe((0.3, 0.5), [], 1.0, (0.5, 0.2), 0.7, inbox=inbox, tick=2))
    assert velocity(told) == pytest.approx(velocity(sensed), abs=1e-12)


def test_a_late_packet_does_not_replace_a_newer_one_and_old_packets_are_removed():
    robot = controller("voronoi-radio", memory_s=1.0)
    half = 5.0 * (0.25 - 0.2)
    newer, older = received(1, 0.5, (0.8, 0.5)), received(1, 0.4, (0.4, 0.5))
    assert velocity(robot.step(observe((0.2, 0.5), [], inbox=(newer, older), tick=6)))[0] == pytest.approx(half)
    assert velocity(robot.step(observe((0.2, 0.5), [], tick=15)))[0] == pytest.approx(half)
    assert velocity(robot.step(observe((0.2, 0.5), [], tick=16))) == (0.0, 0.0)


def test_a_robot_listens_for_a_period_before_it_first_moves():
    robot = controller("voronoi-radio", every_s=0.2)
    moves = [
        velocity(robot.step(observe((0.2, 0.5), [], inbox=(received(1, 0.0, (0.8, 0.5)),), tick=t))) for t in range(4)
    ]
    assert moves[:3] == [(0.0, 0.0)] * 3
    assert moves[3] != (0.0, 0.0)


@given(st.integers(0, 39), st.integers(1, 255))
def test_a_damaged_packet_is_ignored(byte, flip):
    packet = pack(7, NeighbourReport(1.0, 0.5, 0.25, 3.0))
    assert unpack(packet) == (7, NeighbourReport(1.0, 0.5, 0.25, 3.0))
    damaged = bytearray(packet)
    damaged[byte] ^= flip
    assert unpack(bytes(damaged)) is None
    assert unpack(packet[:-1]) is None
    assert unpack(pack(7, NeighbourReport(1.0, math.nan, 0.25, 3.0))) is None


def test_robots_send_in_turn_and_at_the_set_period():
    robots = [controller("voronoi-radio", node=node, every_s=0.3) for node in range(3)]
    spoke = [[bool(robot.step(observe((0.5, 0.5), [], tick=tick)).outbox) for robot in robots] for tick in range(6)]
    assert [sum(tick) for tick in spoke] == [1] * 6
    assert [sum(robot) for robot in zip(*spoke, strict=True)] == [2, 2, 2]


# --- the quadratic estimate -----------------------------------------------------------------------------------------


class Paraboloid:
    """value + g q + q H q / 2."""

    def __init__(self, value, gx, gy, bend):
        self.value_here, self.gx, self.gy, self.bend = value, gx, gy, bend

    def value(self, points):
        x, y = points.T
        xx, xy, yy = self.bend
        return self.value_here + self.gx * x + self.gy * y + 0.5 * (xx * x * x + yy * y * y) + xy * x * y


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32))
def test_a_quadratic_field_is_fitted_exactly_and_its_centroid_is_exact(seed):
    random = np.random.default_rng(seed)
    others = random.uniform(-0.5, 0.5, (9, 2))
    bend = Curvature(*random.uniform(-2.0, 2.0, 3))
    gx, gy = random.uniform(-1.0, 1.0, 2)
    field: Any = Paraboloid(4.0, gx, gy, bend)
    samples = [
        NeighbourSample(x, y, z) for (x, y), z in zip(others.tolist(), field.value(others).tolist(), strict=True)
    ]
    found = fit(4.0, field.gx, field.gy, samples)
    assert found == pytest.approx(bend, abs=1e-6)
    cell = voronoi_cell([(-0.6, -0.5), (0.5, -0.5), (0.5, 0.4), (-0.6, 0.4)], [(x, y) for x, y, _ in samples])
    exact = integrate([cell], np.zeros((1, 2)), field).centroid[0]
    assert quadratic_centroid(cell, 4.0, field.gx, field.gy, bend) == pytest.approx(tuple(exact), abs=1e-12)


def test_an_estimate_that_may_be_negative_or_is_left_open_gives_way_to_the_linear_one():
    square = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    linear = pytest.approx(linear_centroid(square, 1.0, 0.5, 0.0)[1:])
    assert quadratic_centroid(square, 1.0, 0.5, 0.0, Curvature(-9.0, 0.0, 0.0)) == linear
    assert quadratic_centroid(square, 1.0, 0.5, 0.0, None) == linear
    assert quadratic_centroid(square, 1.0, 0.5, 0.0, Curvature(1.0, 0.0, 0.0)) != linear
    assert (
        fit(
            1.0,
            0.0,
            0.0,
            [NeighbourSample(0.1, 0.0, 1.0), NeighbourSample(0.2, 0.0, 1.5), NeighbourSample(0.0, 0.0, 1.0)],
        )
        is None
    )
    assert fit(1.0, 0.0, 0.0, []) is None


def test_only_robots_whose_cells_border_on_this_one_lend_their_samples():
    near = [
        NeighbourSample(0.2, 0.0, 1.0),
        NeighbourSample(0.0, 0.2, 1.0),
        NeighbourSample(-0.2, 0.0, 1.0),
        NeighbourSample(0.0, -0.2, 1.0),
    ]
    samples = [*near, NeighbourSample(0.3, 0.01, 1.0), NeighbourSample(0.5, 0.5, 1.0), NeighbourSample(0.0, 0.0, 1.0)]
    square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
    assert bordering(voronoi_cell(square, [(x, y) for x, y, _ in samples]), samples) == near


def test_parameters_out_of_range_are_refused():
    with pytest.raises(Exception, match="gain_per_s"):
        controller("voronoi-coverage", gain_per_s=-1.0)
    assert msgspec.convert({}, SwarmBotTable).gradient_magnitude is None
