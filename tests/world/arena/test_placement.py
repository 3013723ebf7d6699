"""Robots start at free places, which depend on the seed and their own id."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import union_all
from shapely.geometry import LineString, MultiPolygon, box

from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import PlacementTable
from zwerm.world.arena.arena import Arena
from zwerm.world.arena.placement import free_spot, place

SQUARE = Arena(box(0, 0, 3, 3))
BUSY = Arena(box(0, 0, 3, 3) - box(1, 1, 2, 1.2) - box(2, 2, 2.5, 2.5), [LineString([(0.5, 0.5), (0.5, 2.5)])])
RADIUS_M = 0.037


def table(kind: str = "uniform", **keys: Any) -> PlacementTable:
    return PlacementTable.model_validate({"kind": kind, **keys})


def placed(arena: Arena, count: int, seed: int = 1, body_m: float = RADIUS_M, **keys: Any) -> Any:
    return place(table(**keys), arena, count, body_m, Draws(seed))


def mistakes(*arguments: Any, **keys: Any) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        placed(*arguments, **keys)
    return caught.value.mistakes


@settings(deadline=None)
@given(
    arena=st.sampled_from([SQUARE, BUSY]),
    count=st.integers(1, 40),
    body_m=st.sampled_from([0.02, 0.1]),
    keys=st.sampled_from(
        [
            {},
            {"kind": "disc", "radius_m": 1.3},
            {"kind": "disc", "radius_m": 1.4, "center_m": (0.9, 1.6)},
            {"kind": "cell", "grid": (2, 1), "radius_m": 1.4},
        ]
    ),
    seed=st.integers(0, 2**32),
)
def test_robots_start_clear_of_walls_and_of_each_other(
    arena: Arena, count: int, body_m: float, keys: Any, seed: int
) -> None:
    position, heading = placed(arena, count, seed, body_m, **keys)
    assert position.shape == (count, 2)
    assert arena.contains(position, body_m).all()
    gap = np.hypot(*(position[:, None] - position).transpose(2, 0, 1))
    assert (gap[~np.eye(count, dtype=np.bool_)] >= 2 * body_m).all()
    assert ((heading >= -np.pi) & (heading < np.pi)).all()


def test_equal_seeds_give_equal_starts_and_another_seed_others() -> None:
    position, heading = placed(BUSY, 25, seed=7)
    again, other = placed(BUSY, 25, seed=7), placed(BUSY, 25, seed=8)
    assert position.tolist() == again[0].tolist()
    assert heading.tolist() == again[1].tolist()
    assert not np.isclose(position, other[0]).all(axis=1).any()
    assert not np.isclose(heading, other[1]).any()


@pytest.mark.parametrize("keys", [{}, {"kind": "disc", "radius_m": 0.8}])
def test_an_additional_robot_moves_no_other_start(keys: Any) -> None:
    fewer, more = placed(BUSY, 60, **keys), placed(BUSY, 61, **keys)
    assert more[0][:60].tolist() == fewer[0].tolist()
    assert more[1][:60].tolist() == fewer[1].tolist()


def test_a_robot_far_from_all_others_starts_where_it_would_start_alone() -> None:
    alone = [place(table(), SQUARE, 1, RADIUS_M, Draws(seed))[0] for seed in (1, 2)]
    assert placed(SQUARE, 25, seed=1)[0][0].tolist() == alone[0][0].tolist()
    thin, thick = (placed(SQUARE, 25, seed=1, body_m=body_m)[0] for body_m in (1e-6, 0.03))
    unmoved = (thin == thick).all(axis=1)
    assert 15 < unmoved.sum() < 25  # thick robots make room for one another, and no other robot moves


def test_uniform_places_fill_the_arena_evenly() -> None:
    position, heading = placed(SQUARE, 3000, body_m=1e-4)
    counts, _, _ = np.histogram2d(position[:, 0], position[:, 1], bins=3, range=((0.0, 3.0), (0.0, 3.0)))
    assert np.abs(counts - 3000 / 9).max() < 5 * np.sqrt(3000 / 9)
    turns, _ = np.histogram(heading, bins=8, range=(-np.pi, np.pi))
    assert np.abs(turns - 3000 / 8).max() < 5 * np.sqrt(3000 / 8)


def test_a_disc_lies_about_its_centre_and_is_filled_evenly() -> None:
    position, _ = place(table("disc", radius_m=0.8, center_m=(1.0, 1.5)), SQUARE, 2000, 1e-4, Draws(3))
    distance = np.hypot(*(position - (1.0, 1.5)).T)
    assert distance.max() <= 0.8
    within_half = (distance < 0.4).mean()  # a quarter of the area
    assert within_half == pytest.approx(0.25, abs=0.05)


def test_a_random_disc_lies_within_the_arenas_bounds_and_not_always_at_one_place() -> None:
    keys: Any = {"kind": "disc", "radius_m": 0.5}
    centers = []
    for seed in range(30):
        position, _ = place(table(**keys), SQUARE, 20, RADIUS_M, Draws(seed))
        centers.append((position.min(axis=0) + position.max(axis=0)) / 2)
        assert np.ptp(position, axis=0).max() <= 1.0
    spread = np.ptp(np.array(centers), axis=0)
    assert (spread > 1.0).all()
    assert (np.array(centers) > 0.3).all()


def test_robots_of_a_cell_lie_about_its_centre() -> None:
    position, _ = place(table("cell", grid=(3, 6), cell=(2, 1), radius_m=0.3), SQUARE, 10, RADIUS_M, Draws(1))
    assert np.hypot(*(position - (2.5, 0.75)).T).max() <= 0.3


def test_a_random_cell_is_any_of_the_grid_whose_centre_is_free() -> None:
    arena = Arena(box(0, 0, 4, 4) - box(1.2, 1.2, 1.8, 1.8))
    cells = set()
    for seed in range(200):
        position, _ = place(table("cell", grid=(4, 4), radius_m=0.3), arena, 1, RADIUS_M, Draws(seed))
        column, row = np.floor(position[0]).astype(int).tolist()
        cells.add((column, row))
    assert cells == {(column, row) for column in range(4) for row in range(4)} - {(1, 1)}


def test_given_poses_are_taken_as_they_are() -> None:
    poses = [(0.5, 0.4, 0.1), (2.0, 2.9, 7.0)]
    position, heading = placed(SQUARE, 2, kind="poses", poses=poses)
    assert np.column_stack([position, heading]).tolist() == [list(pose) for pose in poses]


def test_an_entry_rectangle_stands_in_for_the_arenas_bounds() -> None:
    entry = (0.2, 2.0, 1.0, 2.9)
    position, _ = place(table(), SQUARE, 20, RADIUS_M, Draws(1), entry)
    assert (position >= entry[:2]).all()
    assert (position <= entry[2:]).all()


def test_no_robot_starts_in_a_pocket_that_it_cannot_leave() -> None:
    # A closet of a third of the room's size, whose door is open by 0.1 m.
    room = union_all([box(0, 0, 3, 2), box(2.9, 0.95, 3.3, 1.05), box(3.2, 0, 4.2, 2)])
    slim, stout = (placed(Arena(room), 60, body_m=body_m)[0] for body_m in (0.03, 0.06))
    assert (slim[:, 0] > 3.2).any()
    assert (stout[:, 0] < 3.0).all()


def test_each_of_two_rooms_drawn_apart_gets_robots() -> None:
    position, _ = placed(Arena(MultiPolygon([box(0, 0, 2, 2), box(3, 0, 4, 2)])), 60)
    assert 0 < (position[:, 0] > 3).sum() < 60


@pytest.mark.parametrize(
    ("keys", "lines"),
    [
        ({"kind": "disc"}, ["robots.placement.radius_m: disc needs it, and it is missing"]),
        (
            {"kind": "cell"},
            [
                "robots.placement.grid: cell needs it, and it is missing",
                "robots.placement.radius_m: cell needs it, and it is missing",
            ],
        ),
        ({"kind": "poses"}, ["robots.placement.poses: poses needs it, and it is missing"]),
        ({"radius_m": 0.5}, ["robots.placement.radius_m: uniform takes no such key, got 0.5"]),
        (
            {"kind": "cell", "grid": (3, 4), "cell": (3, 0), "radius_m": 0.3},
            ["robots.placement.cell: expected column < 3 and row < 4, got (3, 0)"],
        ),
        (
            {"kind": "disc", "radius_m": 2},
            ["robots.placement.radius_m: expected at most 1.5, for the disc to lie in the arena's bounds, got 2"],
        ),
        (
            {"kind": "poses", "poses": [(1, 1, 0)]},
            ["robots.placement.poses: expected one for each of 3 robots, got 1"],
        ),
        (
            {"kind": "poses", "poses": [(1, 1, 0), (5, 1, 0), (1.05, 1, 0)]},
            [
                "robots.placement.poses.1: expected free space 0.037 m around, got (5, 1)",
                "robots.placement.poses.2: expected 0.074 m to robot 0, got 0.05 m",
            ],
        ),
        (
            {"kind": "poses", "poses": [(0.02, 1, 0), (1, 1, 0), (2, 1, 0)]},
            ["robots.placement.poses.0: expected free space 0.037 m around, got (0.02, 1)"],
        ),
    ],
)
def test_every_mistake_in_the_table_is_one_line(keys: Any, lines: list[str]) -> None:
    assert mistakes(SQUARE, 3, **keys) == lines


def test_a_robot_without_room_is_named() -> None:
    lines = mistakes(Arena(box(0, 0, 1, 1)), 25, body_m=0.15)
    robot = int(lines[0].split()[5])
    assert 3 < robot < 12
    assert lines == [f"robots.placement: no room for robot {robot} of 25 after 10000 tries"]
    too_wide = mistakes(Arena(box(0, 0, 1, 1) - box(0.4, 0.4, 0.6, 0.6)), 1, body_m=0.3)
    assert too_wide == ["robots.placement: no room for robot 0 of 1 after 10000 tries"]


def test_a_disc_for_which_no_centre_is_free_is_one_line() -> None:
    ring = Arena(box(0, 0, 3, 3) - box(0.5, 0.5, 2.5, 2.5))
    lines = mistakes(ring, 3, kind="disc", radius_m=1.0)
    assert lines == ["robots.placement: no free place for the disc's centre after 10000 tries"]


def test_a_free_spot_is_found_until_the_rectangle_is_full() -> None:
    entry, draws = (0.0, 0.0, 0.5, 0.5), Draws(5)
    occupied = np.empty((0, 2))
    found = 0
    for robot in range(200):
        spot = free_spot(entry, BUSY, occupied, 0.05, draws, "entry", robot, 0)
        if spot is not None:
            found += 1
            assert BUSY.contains(spot[None], 0.05).all()
            assert (spot <= 0.5).all()
            assert len(occupied) == 0 or np.hypot(*(occupied - spot).T).min() >= 0.1
            occupied = np.vstack([occupied, spot])
    assert 5 < found < 25
    repeated = free_spot(entry, BUSY, np.empty((0, 2)), 0.05, Draws(5), "entry", 0, 0)
    assert repeated is not None
    assert repeated.tolist() == occupied[0].tolist()
