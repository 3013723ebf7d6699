"""Scattered landmarks: one within the dispersion of every place, none in a wall, and no two close together."""

import math
from pathlib import Path

import numpy as np
import pytest
from support import scenario

from zwerm.errors import ScenarioError
from zwerm.scenario.tables import ArenaTable, ScatterTable
from zwerm.world.arena.arena import Arena
from zwerm.world.arena.scatter import PLACES_PER_DISPERSION, scatter, with_landmarks

HALL = {"size_m": [6.0, 4.0], "obstacles": [[[2.0, 1.0], [2.2, 1.0], [2.2, 3.0], [2.0, 3.0]]]}


def hall() -> Arena:
    return Arena.from_table(ArenaTable.model_validate(HALL), Path())


@pytest.mark.parametrize("dispersion_m", [0.4, 0.577, 1.0])
def test_every_place_sees_a_landmark_within_the_dispersion(dispersion_m: float) -> None:
    arena = hall()
    landmarks = scatter(ScatterTable(dispersion_m=dispersion_m), arena, 1)
    assert arena.contains(landmarks).all()
    places = np.random.default_rng(0).uniform((0.0, 0.0), (6.0, 4.0), (400, 2))
    slack_m = math.sqrt(2.0) * dispersion_m / PLACES_PER_DISPERSION
    for place in places[arena.contains(places, slack_m)]:
        near = landmarks[np.hypot(*(landmarks - place).T) <= dispersion_m + 2.0 * slack_m]
        assert not arena.blocked(np.broadcast_to(place, near.shape), near).all()


def test_landmarks_that_see_each_other_are_apart() -> None:
    arena = hall()
    landmarks = scatter(ScatterTable(dispersion_m=0.5), arena, 1)
    i, j = np.triu_indices(len(landmarks), 1)
    near = np.hypot(*(landmarks[i] - landmarks[j]).T) < 0.5
    assert arena.blocked(landmarks[i[near]], landmarks[j[near]]).all()
    # Without the wall's help the packing is that of a maximal Poisson-disc sample: 0.7 to 0.8 a square of the dispersion.
    assert 0.6 < len(landmarks) * 0.5**2 / arena.area_m2 < 0.9


def test_landmarks_depend_on_the_seed_of_the_run_or_on_their_own() -> None:
    arena = hall()
    of_run = [scatter(ScatterTable(dispersion_m=0.8), arena, seed).tolist() for seed in (1, 1, 2)]
    assert of_run[0] == of_run[1] != of_run[2]
    own = [scatter(ScatterTable(dispersion_m=0.8, seed=7), arena, seed).tolist() for seed in (1, 2)]
    assert own[0] == own[1]


def test_a_scenario_with_landmarks_keeps_them() -> None:
    given = scenario(scatter={"dispersion_m": 0.5}, landmarks=[[1.0, 1.0]])
    assert with_landmarks(given, 1).landmarks == [(1.0, 1.0)]
    assert len(with_landmarks(scenario(scatter={"dispersion_m": 0.5}), 1).landmarks) > 5
    assert with_landmarks(scenario(), 1).landmarks == []


def test_a_dispersion_too_fine_for_the_arena_is_one_line() -> None:
    with pytest.raises(ScenarioError, match=r"scatter\.dispersion_m: expected at most 4000000 places"):
        scatter(ScatterTable(dispersion_m=0.01), hall(), 1)
