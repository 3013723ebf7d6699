"""Landmarks scattered at random with a given dispersion: a maximal Poisson-disc sample of the free space.

Dispersion is the greatest distance from a place in free space to the nearest landmark that is visible there (Ramaithitima and
Bhattacharya 2018, section III-B). Places are those of a grid, tried in a random order: a place becomes a landmark where no
visible landmark is within the dispersion. So landmarks that see each other are at least about that far apart, and every
place of the grid has one in reach. (Uniform sampling until all is covered takes four times as many.)
"""

from typing import Final

import numpy as np

from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import ScatterTable, Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.geometry.search_tree import tree_of
from zwerm.world.scene import Floats

# The grid of places is this many times finer than the dispersion.
PLACES_PER_DISPERSION: Final = 10

# More places than this are refused: the dispersion is too small for the arena.
PLACES_MAX: Final = 4_000_000


def scatter(table: ScatterTable, arena: Arena, seed: int) -> Floats:
    """Return (l, 2) landmarks [m] in the free space of `arena`, in the order of their ids.

    Raises ScenarioError where the arena has too many places to try.
    """
    draws = Draws(seed if table.seed is None else table.seed)
    spacing = table.dispersion_m / PLACES_PER_DISPERSION
    xmin, ymin, xmax, ymax = arena.bounds
    columns, rows = int(np.ceil((xmax - xmin) / spacing)), int(np.ceil((ymax - ymin) / spacing))
    if columns * rows > PLACES_MAX:
        rule = f"expected at most {PLACES_MAX} places of a grid {spacing:g} m wide in the arena's bounds"
        raise ScenarioError([f"scatter.dispersion_m: {rule}, got {columns * rows}"])
    cell = np.arange(columns * rows)
    # Anywhere in its cell, so that landmarks are not collinear.
    offset = draws.uniform("landmark-scatter-place", cell[:, None], np.arange(2))
    places = np.array([xmin, ymin]) + spacing * (np.column_stack([cell % columns, cell // columns]) + offset)
    inside = arena.contains(places)
    places, cell = places[inside], cell[inside]
    tree = tree_of(places)
    covered = np.zeros(len(places), dtype=np.bool_)
    chosen: list[int] = []
    for place in np.argsort(draws.bits("landmark-scatter-order", cell), kind="stable").tolist():
        if covered[place]:
            continue
        chosen.append(place)
        near = np.array(tree.query_ball_point(places[place], table.dispersion_m, return_sorted=True))
        near = near[~covered[near]]
        start = np.broadcast_to(places[place], (len(near), 2))
        covered[near[~arena.blocked(start, places[near])]] = True
        covered[place] = True
    return places[chosen]


def with_landmarks(scenario: Scenario, seed: int) -> Scenario:
    """Return `scenario` with its landmarks scattered for `seed`, or as it is where it scatters none or has them already.

    Raises ScenarioError with every mistake in the arena.
    """
    if scenario.scatter is None or scenario.landmarks:
        return scenario
    arena = Arena.from_table(scenario.arena, scenario.folder)
    landmarks = [(x, y) for x, y in scatter(scenario.scatter, arena, seed).tolist()]
    return scenario.model_copy(update={"landmarks": landmarks})
