"""The picture layer of landmark-based exploration: the complex, open frontiers and assignments are where they should be."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from PIL import Image
from shapely.geometry import box

from zwerm.agents.landmark_exploration.mapping.map_reports import GoalReport, MapReport, write_report
from zwerm.record.history import History
from zwerm.view.animation import animate_run
from zwerm.view.canvas import Sheet
from zwerm.view.layers.landmark_exploration import (
    ASSIGNED,
    FRONTIER,
    SIMPLEX,
    LandmarkComplexLayer,
    LandmarkNavigationLayer,
)
from zwerm.view.run_view import RunView
from zwerm.view.stills import draw_run
from zwerm.world.arena.arena import Arena
from zwerm.world.tick.telemetry import TelemetryRecord

LANDMARKS = ((0.5, 0.5), (1.5, 0.5), (1.0, 1.5), (3.5, 0.5), (3.5, 1.5))
PLACES = np.array([(0.4, 1.7), (3.0, 1.0)])
COORDINATOR = 2

# At 1 s a triangle with two frontiers, one of them assigned; at 2 s the second triangle, and no frontier.
REPORTS = {
    1.0: MapReport(((0, 1, 2),), ((0, 1, 2),), open=2, frontiers=((1, 2), (0, 1)), assigned=((0, 0, 1),)),
    2.0: MapReport(((1, 2, 3), (3, 4)), ((0, 1, 2), (0, 1)), open=0, done=True),
}


def view(until_s: float = 2.0) -> RunView:
    history = History()
    for time_s in (0.0, 1.0, 2.0, 3.0):
        history.append(
            SimpleNamespace(time_s=time_s, position=PLACES, heading=np.zeros(2), present=np.ones(2, dtype=bool))
        )
    records = [
        TelemetryRecord(round(10 * time_s), time_s, COORDINATOR, {}, write_report(report), PLACES, np.ones(2, bool))
        for time_s, report in REPORTS.items()
        if time_s <= until_s
    ]
    layers = (f"{LandmarkComplexLayer.__module__}:{LandmarkComplexLayer.__name__}",)
    return RunView(
        Arena(box(0, 0, 4, 2)), history, 0.05, "trial", snapshots=records, layers=layers, coordinator=COORDINATOR,
        landmarks=LANDMARKS,
    )  # fmt: skip


def rgb(name: str) -> tuple[int, ...]:
    return tuple(round(255 * each) for each in to_rgb(name))


class Picture:
    """The colours of the layer at a time, near places of the arena."""

    def __init__(self, at_s: float | None) -> None:
        run = view()
        self._sheet = Sheet(run.arena, "trial")
        layer = LandmarkComplexLayer(self._sheet, run)
        layer.show(run.history.arrays(), 1, at_s)
        self._sheet.canvas.draw()
        self._pixels: NDArray[np.uint8] = np.asarray(self._sheet.canvas.buffer_rgba())

    def shows(self, colour: str, x_m: float, y_m: float) -> bool:
        """Return whether a pixel within 4 of a place is of about this colour: thin lines have soft edges."""
        across, up = self._sheet.axes.transData.transform((x_m, y_m))
        row, column = len(self._pixels) - 1 - int(up), int(across)
        near = self._pixels[row - 4 : row + 5, column - 4 : column + 5, :3].reshape(-1, 3).astype(int)
        return bool((np.abs(near - rgb(colour)).max(axis=1) < 60).any())


def on_a_dash(picture: Picture, colour: str, a: int, b: int) -> bool:
    places = [np.array(LANDMARKS[a]) + t * (np.array(LANDMARKS[b]) - LANDMARKS[a]) for t in (0.4, 0.45, 0.5, 0.55, 0.6)]
    return any(picture.shows(colour, *place) for place in places)


def test_a_simplex_is_shown_from_the_time_at_which_it_was_reported() -> None:
    first, last = Picture(1.0), Picture(None)
    assert first.shows(SIMPLEX, 1.0, 0.9)
    assert last.shows(SIMPLEX, 1.0, 0.9)
    assert not first.shows(SIMPLEX, 2.4, 0.75)
    assert last.shows(SIMPLEX, 2.4, 0.75)
    assert not last.shows(SIMPLEX, 0.3, 1.2)
    assert not Picture(0.5).shows(SIMPLEX, 1.0, 0.9)


def test_frontiers_and_assignments_are_those_of_the_newest_report() -> None:
    first, last = Picture(1.0), Picture(None)
    assert on_a_dash(first, FRONTIER, 1, 2)
    assert not on_a_dash(first, FRONTIER, 3, 4)
    assert not on_a_dash(last, FRONTIER, 1, 2)
    # From robot 0 to the middle of the frontier <0, 1>.
    middle = (PLACES[0] + np.array([1.0, 0.5])) / 2.0
    assert first.shows(ASSIGNED, *middle)
    assert not last.shows(ASSIGNED, *middle)


def test_a_set_of_one_or_two_landmarks_has_no_area() -> None:
    run = view()
    layer = LandmarkComplexLayer(Sheet(run.arena, "trial"), run)
    layer.show(run.history.arrays(), 1, None)
    simplices, edges = layer.artists[:2]
    assert len(simplices.get_paths()) == 2
    assert len(edges.get_segments()) == 3


def test_the_legend_names_all_that_is_shown() -> None:
    run = view()
    labels = [str(each.get_label()) for each in LandmarkComplexLayer(Sheet(run.arena, "trial"), run).legend()]
    assert labels == ["landmark", "simplex: landmarks seen together", "open frontier", "robot and its frontier"]


def pixels(image: Image.Image, colour: str) -> int:
    """Return how many pixels have exactly this colour."""
    counts = {each: count for count, each in image.convert("RGB").getcolors(1 << 20) or []}
    return counts.get(rgb(colour), 0)


def test_stills_and_animations_show_the_complex_with_its_frontiers(tmp_path: Path) -> None:
    with Image.open(draw_run(tmp_path / "run.png", view(1.0))) as picture:
        assert pixels(picture, SIMPLEX) > 1_000
        assert pixels(picture, FRONTIER) > 50
    path = animate_run(tmp_path / "run.gif", view(), fps=2, speed_up=1.0)
    simplex, frontier = [], []
    with Image.open(path) as animation:
        for number in range(getattr(animation, "n_frames")):  # noqa: B009 - it is not typed
            animation.seek(number)
            simplex.append(pixels(animation, SIMPLEX))
            frontier.append(pixels(animation, FRONTIER))
    # The legend has both colours in every frame: what is above it is the complex.
    assert simplex == sorted(simplex)
    assert len(set(simplex)) == 3
    assert simplex[0] + 1_000 < simplex[-1]
    assert frontier[0] < max(frontier)
    assert frontier[-1] == frontier[0]


@pytest.mark.parametrize("count", [0, 1])
def test_a_run_without_landmarks_has_no_such_layer(count: int) -> None:
    run = RunView(Arena(box(0, 0, 4, 2)), History(), 0.05, "trial", landmarks=LANDMARKS[:count])
    assert LandmarkComplexLayer.applies(run) is bool(count)


# Robot 0 goes to one goal until 1 s, and to another until 3 s; robot 1 goes to a goal of one landmark.
GOALS = (
    (1.0, 0, GoalReport((0, 1, 2), True, 10)),
    (2.0, 1, GoalReport((3,), True, 20)),
    (3.0, 0, GoalReport((1, 3, 4, 99), True, 20)),  # the arena has no landmark 99
)


def navigation(at_s: float | None) -> tuple[list[tuple[float, ...]], list[NDArray[np.float64]]]:
    """Return the bounds [m] of the goals that are shown at a time, and the ways."""
    history = History()
    for time_s in (0.0, 1.0, 2.0, 3.0):
        moved = PLACES + np.array([time_s, 0.0])
        history.append(
            SimpleNamespace(time_s=time_s, position=moved, heading=np.zeros(2), present=np.ones(2, dtype=bool))
        )
    records = [
        TelemetryRecord(round(10 * time_s), time_s, node, {}, write_report(report), PLACES, np.ones(2, bool))
        for time_s, node, report in GOALS
    ]
    run = RunView(Arena(box(0, 0, 4, 2)), history, 0.05, "trial", snapshots=records, landmarks=LANDMARKS)
    assert LandmarkNavigationLayer.applies(run)
    layer = LandmarkNavigationLayer(Sheet(run.arena, "trial"), run)
    layer.show(run.history.arrays(), 1, at_s)
    goals, ways = layer.artists
    corners = [path.vertices for path in goals.get_paths()]
    bounds = [(*each.min(axis=0), *each.max(axis=0)) for each in corners]
    return bounds, [np.asarray(each) for each in ways.get_segments()]


def test_each_robot_is_shown_with_its_goal_at_the_time_and_its_way_since_the_goal_before() -> None:
    slack = pytest.approx
    goals, ways = navigation(0.5)
    assert goals[0] == slack((0.45, 0.45, 1.55, 1.55), abs=0.02)
    assert goals[1] == slack((3.45, 0.45, 3.55, 0.55), abs=0.02)
    assert [each[:, 0].tolist() for each in ways] == [slack([0.4]), slack([3.0])]
    goals, ways = navigation(2.0)
    assert goals[0] == slack((1.45, 0.45, 3.55, 1.55), abs=0.02)
    assert [each[:, 0].tolist() for each in ways] == [slack([1.4, 2.4]), slack([3.0, 4.0, 5.0])]
    goals, ways = navigation(None)
    assert goals[0] == slack((1.45, 0.45, 3.55, 1.55), abs=0.02)
    assert [each[:, 0].tolist() for each in ways] == [slack([1.4, 2.4, 3.4]), slack([3.0, 4.0, 5.0])]


def test_only_what_the_run_reported_is_in_the_legend() -> None:
    run = view(0.5)
    labels = [str(each.get_label()) for each in LandmarkComplexLayer(Sheet(run.arena, "trial"), run).legend()]
    assert labels == ["landmark"]
    assert not LandmarkNavigationLayer.applies(run)
