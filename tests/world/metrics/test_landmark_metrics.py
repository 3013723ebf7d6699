"""MapCompletion: the fraction of places whose visible landmarks were all seen together."""

from pathlib import Path

import numpy as np

from zwerm.scenario.tables import ArenaTable
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics.landmark_exploration import MapCompletion, maximal, visible

LANDMARKS = np.array([(0.5, 0.5), (1.5, 0.5), (3.5, 0.5)])


def hall(walls: list[list[list[float]]] | None = None) -> Arena:
    return Arena.from_table(ArenaTable.model_validate({"size_m": [4.0, 1.0], "walls": walls or []}), Path())


def test_nothing_is_covered_before_anything_is_seen_and_all_when_every_set_was() -> None:
    arena = hall()
    completion = MapCompletion(arena, LANDMARKS, 1.0)
    assert completion.places == 40 * 10
    assert completion.fraction == 0.0
    places = np.column_stack([np.linspace(0.05, 3.95, 40), np.full(40, 0.5)])
    completion.add(visible(arena, LANDMARKS, 1.0, places))
    assert 0.9 < completion.fraction <= 1.0


def test_a_simplex_covers_the_places_that_see_a_face_of_it() -> None:
    completion = MapCompletion(hall(), LANDMARKS, 1.0)
    completion.add([(2,)])
    alone = completion.fraction
    assert 0.2 < alone < 0.4
    completion.add([(0, 1)])
    both = completion.fraction
    assert both > alone + 0.3
    completion.add([(0,), (1, 0), (2,)])
    assert completion.fraction == both


def test_a_wall_hides_landmarks() -> None:
    seen = visible(hall([[[1.0, 0.0], [1.0, 1.0]]]), LANDMARKS, 1.0, np.array([(0.8, 0.5), (1.2, 0.5)]))
    assert seen == [[0], [1]]


def test_where_nothing_is_visible_nothing_can_be_covered() -> None:
    completion = MapCompletion(hall(), np.array([(0.5, 0.5)]), 0.3)
    completion.add([(0,)])
    assert 0.0 < completion.fraction < 0.2


def test_maximal_simplices_are_no_faces() -> None:
    assert sorted(maximal([(1, 2), (2, 1, 3), (3,), (4,), (3, 2, 1), ()])) == [(1, 2, 3), (4,)]
