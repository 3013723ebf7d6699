"""Pictures: the data of the run is at its place on the sheet, and every error is one line."""

import math
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from PIL import Image
from shapely.geometry import LineString, Polygon, box

from zwerm.agents.sensor_coverage.messages.snapshots import ComplexSnapshot, encode_snapshot
from zwerm.errors import PictureError
from zwerm.record.history import History
from zwerm.view.animation import animate_run
from zwerm.view.canvas import Sheet, outline, readable, round_down
from zwerm.view.composition import Composition
from zwerm.view.coverage_curve import coverage_curve
from zwerm.view.layers.sensor_coverage import FRONTIER, OBSTACLE, PUSH, ComplexLayer, Snapshot, snapshots, true_snapshot
from zwerm.view.layers.sensor_coverage import TRIANGLE as FILL
from zwerm.view.run_view import RunView
from zwerm.view.stills import draw_run
from zwerm.view.swarm_artists import Swarm, gone_at_the_end
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics.sight import SeenArea
from zwerm.world.tick.telemetry import TelemetryRecord

RADIUS_M = 0.1

# 4 x 2 m with a pillar, and a wall without thickness at x = 2.
ARENA = Arena(box(0, 0, 4, 2).difference(box(3.4, 0.8, 3.8, 1.2)), [LineString([(2, 0), (2, 1)])])


def history_of(*moments: tuple[list[tuple[float, float]], list[bool]], every_s: float = 1.0) -> History:
    history = History()
    for index, (position, present) in enumerate(moments):
        where = np.array(position, dtype=np.float64).reshape(-1, 2)
        history.append(
            SimpleNamespace(
                time_s=index * every_s,
                position=where,
                heading=np.zeros(len(where)),
                present=np.array(present, dtype=bool),
            )
        )
    return history


# Robot 0 walks right, robot 1 leaves, robot 2 never enters.
HISTORY = history_of(
    ([(0.5, 0.5), (0.5, 1.5), (9.0, 9.0)], [True, True, False]),
    ([(0.7, 0.5), (0.5, 1.5), (9.0, 9.0)], [True, True, False]),
    ([(1.0, 0.5), (0.5, 1.5), (9.0, 9.0)], [True, False, False]),
)

VIEW = RunView(ARENA, HISTORY, RADIUS_M, "trial")

WHITE, BLUE, SKY, DARK, GREY = (255, 255, 255), (0, 114, 178), (86, 180, 233), (34, 34, 34), (228, 228, 228)


def near(one: tuple[int, ...], other: tuple[int, ...], tolerance: int = 12) -> bool:
    return all(abs(a - b) <= tolerance for a, b in zip(one, other, strict=True))


class Look:
    """The colours of a sheet, by place in the arena."""

    def __init__(self, sheet: Sheet) -> None:
        sheet.canvas.draw()
        self._pixels: NDArray[np.uint8] = np.asarray(sheet.canvas.buffer_rgba())
        self._sheet = sheet

    def at(self, x_m: float, y_m: float) -> tuple[int, ...]:
        across, up = self._sheet.axes.transData.transform((x_m, y_m))
        return tuple(self._pixels[len(self._pixels) - 1 - int(up), int(across), :3].tolist())


def drawn(
    index: int, since: int = 0, coverage_radius_m: float | None = None, cells: tuple[int, int] | None = None
) -> Look:
    sheet = Sheet(ARENA, "trial")
    swarm = Swarm(sheet, ARENA, HISTORY.arrays(), RADIUS_M, coverage_radius_m, cells)
    swarm.show(index, since)
    return Look(sheet)


def test_the_arena_is_white_inside_its_walls_and_grey_outside_and_in_its_pillars() -> None:
    look = drawn(0)
    assert look.at(1.5, 1.8) == WHITE
    assert near(look.at(3.6, 1.0), GREY)
    assert near(look.at(-0.04, 1.0), GREY)
    assert near(look.at(0.0, 1.0), DARK)
    assert near(look.at(2.0, 0.5), DARK)
    assert near(look.at(3.4, 1.0), DARK)
    assert look.at(2.0, 1.5) == WHITE


def test_robots_are_drawn_at_their_positions_with_the_nose_ahead_and_absent_ones_are_not() -> None:
    look = drawn(2, since=2)
    assert look.at(0.93, 0.5) == BLUE
    assert near(look.at(1.05, 0.5), DARK)
    assert near(look.at(1.15, 0.5), DARK)
    assert look.at(0.5, 0.5) == WHITE
    assert look.at(0.5, 1.5) == WHITE
    assert drawn(0, since=0).at(0.45, 1.5) == BLUE


def test_paths_are_drawn_from_the_requested_sample() -> None:
    assert drawn(2, since=0).at(0.6, 0.5) != WHITE
    assert drawn(2, since=1).at(0.6, 0.5) == WHITE
    assert drawn(2, since=1).at(0.8, 0.5) != WHITE


def test_the_covered_area_inside_the_arena_is_tinted() -> None:
    look = drawn(2, coverage_radius_m=0.7)
    tint = tuple(round(255 * 0.75 + each * 0.25) for each in SKY)
    assert near(look.at(1.0, 1.1), tint, 2)
    assert look.at(1.0, 1.3) == WHITE
    assert near(look.at(1.0, -0.04), GREY)


def test_cells_with_a_robot_are_tinted_and_framed_where_a_tint_is_taken() -> None:
    tinted = drawn(2, since=2, cells=(4, 2))
    assert tinted.at(1.5, 0.2) != WHITE  # robot 0 is at (1, 0.5): on the edge counts to the right
    assert tinted.at(0.5, 0.2) == WHITE
    assert tinted.at(0.5, 1.2) == WHITE
    framed = drawn(2, since=2, coverage_radius_m=0.05, cells=(4, 2))
    assert framed.at(1.5, 0.2) == WHITE
    assert framed.at(1.5, 0.035) != WHITE


def test_a_frame_of_an_animation_is_the_same_as_a_sheet_drawn_whole() -> None:
    frozen = Sheet(ARENA, "trial")
    swarm = Swarm(frozen, ARENA, HISTORY.arrays(), RADIUS_M, 0.7)
    frozen.freeze(swarm.artists)
    swarm.show(0, 0)
    earlier = frozen.frame().copy()
    swarm.show(2, 1)
    whole = Sheet(ARENA, "trial")
    Swarm(whole, ARENA, HISTORY.arrays(), RADIUS_M, 0.7).show(2, 1)
    whole.canvas.draw()
    assert np.abs(frozen.frame().astype(int) - np.asarray(whole.canvas.buffer_rgba())).max() <= 2
    assert (earlier != frozen.frame()).any()


def test_a_dead_robot_is_crossed_out_where_it_died() -> None:
    history = History()
    for dead in ((), (1, 7)):  # node 7 is no robot
        history.append(MOMENT, dead)
    sheet = Sheet(ARENA, "trial")
    swarm = Swarm(sheet, ARENA, history.arrays(), RADIUS_M, plain=True)
    swarm.show(1, 0)
    look = Look(sheet)
    assert look.at(1.0, 0.5) == BLUE
    assert near(look.at(1.0, 1.5), DARK, 40)
    assert look.at(1.07, 1.5) == WHITE
    assert [each.get_label() for each in swarm.legend()] == ["1 robot at 0 s", "dead robots"]


def test_the_area_in_sight_is_tinted_and_the_area_behind_a_wall_is_not() -> None:
    sheet = Sheet(ARENA, "trial")
    swarm = Swarm(sheet, ARENA, HISTORY.arrays(), RADIUS_M, sight=SeenArea(ARENA, 2.0))
    swarm.show(2, 2)
    look = Look(sheet)
    assert look.at(1.5, 0.7) != WHITE
    assert look.at(2.5, 0.5) == WHITE  # behind the wall without thickness
    assert look.at(1.0, 1.9) != WHITE


@pytest.mark.parametrize(("length_m", "bar_m"), [(1.0, 1.0), (1.99, 1.0), (2.04, 2.0), (0.7, 0.5), (30.0, 20.0)])
def test_a_scale_bar_is_a_round_number_of_metres(length_m: float, bar_m: float) -> None:
    assert round_down(length_m) == pytest.approx(bar_m)


LAYERS = ("zwerm.view.layers.sensor_coverage:ComplexLayer",)

# --- a deployment ---------------------------------------------------------------------------------------------------

# Three robots at the corners of a triangle; robot 0 is the base, and pushes robot 1, who goes ahead.
TRIANGLE = np.array([(0.5, 0.5), (1.5, 0.5), (1.0, 1.3)])
MOMENT = SimpleNamespace(
    time_s=0.0, position=np.array([(1.0, 0.5), (1.0, 1.5)]), heading=np.zeros(2), present=np.ones(2, dtype=bool)
)


def deployment(cycles: int = 3) -> RunView:
    """A run of `cycles` s; the complex is reported once a second, and turns from frontier to obstacle at the last."""
    history = history_of(*[(TRIANGLE.tolist(), [True] * 3) for _ in range(cycles + 1)])
    reported = [
        TelemetryRecord(
            0, float(cycle), 3, {},
            encode_snapshot(ComplexSnapshot(
                cycle, edges=((0, 1), (0, 2), (1, 2)), paths=((0, 1),),
                frontier=((1, 2),) if cycle < cycles else (), obstacle=() if cycle < cycles else ((1, 2),),
            )),
            TRIANGLE, np.ones(3, bool),
        )
        for cycle in range(1, cycles + 1)
    ]  # fmt: skip
    series = {"time_s": [0.0, 3.0], "coverage_fraction": [0.2, 0.8], "robots_deployed": [1.0, 3.0]}
    return RunView(
        ARENA, history, RADIUS_M, "trial", sight_range_m=1.0, bases=1, snapshots=reported, series=series, layers=LAYERS
    )


def shown(view: RunView, snapshot: Snapshot | None) -> Look:
    sheet = Sheet(ARENA, "trial")
    ComplexLayer(sheet, view).show_snapshot(snapshot)
    return Look(sheet)


def test_the_complex_shows_triangles_frontier_obstacle_and_the_push() -> None:
    view = deployment()
    opening, _, closing = snapshots(view.snapshots)
    first, last = shown(view, opening), shown(view, closing)
    assert first.at(1.0, 0.8) == last.at(1.0, 0.8) == tuple(round(255 * each) for each in to_rgb(FILL["facecolor"]))
    assert first.at(1.25, 0.9) == tuple(round(255 * each) for each in to_rgb(FRONTIER))
    assert last.at(1.25, 0.9) == tuple(round(255 * each) for each in to_rgb(OBSTACLE))
    assert first.at(1.0, 0.5) == tuple(round(255 * each) for each in to_rgb(PUSH))
    assert shown(view, None).at(1.0, 0.8) == WHITE


def test_without_a_reported_complex_the_true_one_is_drawn(tmp_path: Path) -> None:
    # Robot 1 is behind the wall without thickness, robot 4 is out of range, robot 5 dead.
    places = np.array([(1.9, 0.5), (2.1, 0.5), (1.5, 0.5), (1.7, 0.9), (0.3, 1.8), (1.8, 0.6)])
    standing = np.array([True, True, True, True, True, False])
    stage = true_snapshot(0.0, places, standing, ARENA, 1.0)
    assert sorted(map(sorted, stage.edges.tolist())) == [[0, 2], [0, 3], [2, 3]]
    assert stage.triangles.tolist() == [[0, 2, 3]]
    assert len(true_snapshot(0.0, places, np.eye(6, dtype=bool)[0], ARENA, 1.0).edges) == 0
    told = deployment()
    untold = replace(told, snapshots=())
    assert Composition(untold).layers
    assert not Composition(replace(untold, bases=0)).layers
    pictures = [draw_run(tmp_path / f"{name}.png", view) for name, view in (("told", told), ("untold", untold))]
    assert len({path.read_bytes() for path in pictures}) == 2


def test_several_paths_are_all_shown() -> None:
    reported = encode_snapshot(ComplexSnapshot(1, ((0, 1), (0, 2)), (), (), ((0, 1), (0, 2))))
    [stage] = snapshots([TelemetryRecord(0, 0.0, 3, {}, reported, TRIANGLE, np.ones(3, bool))])
    assert stage.paths == ((0, 1), (0, 2))
    assert len(stage.triangles) == 0
    look = shown(deployment(), stage)
    assert look.at(1.0, 0.5) == look.at(0.75, 0.9) == tuple(round(255 * each) for each in to_rgb(PUSH))


def test_the_coverage_curve_is_over_cycles_if_there_are_any_and_else_over_time() -> None:
    view = deployment()
    curve = Composition(view).curve
    assert curve is not None
    assert curve.xlabel == "deployment cycle"
    assert curve.x.tolist() == [0.0, 3.0]
    assert curve.at(1.5) == (1.5, pytest.approx(0.5))
    assert curve.ideal == pytest.approx((8.0 - 0.16) / (math.sqrt(3.0) / 2.0))
    by_time = coverage_curve(view.series, [], "")
    assert by_time is not None
    assert by_time.xlabel == "time [s]"
    assert coverage_curve({}, [], "") is None


def test_a_deployment_is_drawn_at_its_end_at_a_cycle_and_at_a_time(tmp_path: Path) -> None:
    view = deployment()
    pictures = [
        draw_run(tmp_path / "end.png", view, {"coverage_fraction": 0.8, "messages_per_robot_mean": 9.0}),
        draw_run(tmp_path / "cycle.png", view, cycle=1),
        draw_run(tmp_path / "time.png", view, at_s=0.5),
    ]
    assert len({path.read_bytes() for path in pictures}) == 3
    with pytest.raises(PictureError, match="cycle 4: expected one that the run reported, which are 1 to 3"):
        draw_run(tmp_path / "none.png", view, cycle=4)
    with pytest.raises(PictureError, match="7 s: expected a time of the run, which lasted 3 s"):
        draw_run(tmp_path / "none.png", view, at_s=7.0)
    with pytest.raises(PictureError, match="stage 1: expected one that the run reported, which are none"):
        draw_run(tmp_path / "none.png", VIEW, cycle=1)


def test_an_animation_of_a_deployment_keeps_the_colours_that_its_first_frame_does_not_have(tmp_path: Path) -> None:
    path = animate_run(tmp_path / "run.gif", deployment(), fps=2, speed_up=1.0)
    with Image.open(path) as animation:
        animation.seek(4)
        colours = {colour for _, colour in animation.convert("RGB").getcolors(1 << 20) or []}
    assert {tuple(round(255 * each) for each in to_rgb(name)) for name in ("white", FRONTIER, PUSH)} <= colours


def test_a_layer_of_a_users_own_is_drawn_and_a_wrong_name_is_one_line(tmp_path: Path) -> None:
    own = replace(VIEW, layers=("own_layers:Crosshair",))
    with Image.open(draw_run(tmp_path / "own.png", own)) as picture:
        colours = {colour for _, colour in picture.convert("RGB").getcolors(1 << 20) or []}
    assert (255, 0, 255) in colours
    with pytest.raises(PictureError, match="module 'own_layers' has no class 'Other'"):
        draw_run(tmp_path / "none.png", replace(VIEW, layers=("own_layers:Other",)))
    with pytest.raises(PictureError, match="own_layers:Line2D is no picture layer"):
        draw_run(tmp_path / "none.png", replace(VIEW, layers=("own_layers:Line2D",)))


def test_robots_that_left_are_distinguished_from_those_that_never_entered() -> None:
    assert gone_at_the_end(HISTORY.arrays()).tolist() == [1]


def test_the_outline_of_an_area_keeps_its_holes_and_leaves_out_lines() -> None:
    ring = outline(box(0, 0, 4, 4).difference(box(1, 1, 3, 3)))
    assert ring.contains_point((0.5, 0.5))
    assert np.shape(outline(Polygon()).vertices)[0] == 0
    assert np.shape(outline(LineString([(0, 0), (1, 1)])).vertices)[0] == 0


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("cell_coverage_fraction", "cell coverage"),
        ("distance_m", "distance"),
        ("deployment_cycles", "deployment cycles"),
    ],
)
def test_the_label_of_a_metric_in_a_picture_is_words(name: str, words: str) -> None:
    assert readable(name) == words


# --- files ----------------------------------------------------------------------------------------------------------


def picture(path: Path, arena: Arena = ARENA, history: History = HISTORY) -> Path:
    metrics = {"area_coverage_fraction": 0.5, "robots_in_arena": 1.0}
    return draw_run(path, RunView(arena, history, RADIUS_M, "trial, seed 1", "3 s", 0.7, (4, 2)), metrics)


@pytest.mark.parametrize("suffix", [".png", ".PNG", ".svg", ".pdf"])
def test_a_picture_creates_its_folder_and_has_the_format_of_its_suffix(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / "new" / f"run{suffix}"
    assert picture(path) == path
    assert path.read_bytes()[:4] in (b"\x89PNG", b"<?xm", b"%PDF")


@pytest.mark.parametrize("size_m", [(0.3, 30.0), (30.0, 0.3), (3.0, 3.0)])
def test_an_arena_of_any_shape_fits_on_a_sheet(tmp_path: Path, size_m: tuple[float, float]) -> None:
    arena = Arena(box(0, 0, *size_m))
    history = history_of(([(0.1, 0.1)], [True]))
    with Image.open(picture(tmp_path / "run.png", arena, history)) as sheet:
        width, height = sheet.size
    assert 600 < width < 1500
    assert 300 < height < 1800


def test_a_run_whose_robots_have_all_left_can_be_drawn(tmp_path: Path) -> None:
    history = history_of(([(1.0, 1.0)], [True]), ([(1.0, 1.0)], [False]))
    assert picture(tmp_path / "run.png", history=history).stat().st_size > 0


def test_an_animation_shows_the_whole_run_and_reports_its_progress(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    path = animate_run(
        tmp_path / "run.gif", VIEW, fps=10, speed_up=1.0,
        progress=lambda done, total: told.append((done, total)),
    )  # fmt: skip
    assert told == [(done, 21) for done in range(1, 22)]
    with Image.open(path) as animation:
        assert animation.info["duration"] == 100
        # Frames that show the same are one that lasts longer; the clock makes them all differ.
        assert getattr(animation, "n_frames") == 21  # noqa: B009 - it is not typed
        first = np.asarray(animation.convert("RGB")).astype(int)
        animation.seek(20)
        last = np.asarray(animation.convert("RGB")).astype(int)
    assert (np.abs(first - last).sum(axis=2) > 60).sum() > 100


def test_an_animation_lasts_about_ten_seconds_by_default(tmp_path: Path) -> None:
    history = history_of(*[([(0.5 + index / 100, 0.5)], [True]) for index in range(200)], every_s=5.0)
    told: list[int] = []
    animate_run(
        tmp_path / "run.gif",
        RunView(ARENA, history, RADIUS_M, "trial"),
        fps=2,
        progress=lambda done, total: told.append(total),
    )
    assert told[-1] == 21


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("run.jpeg", "expected a file that ends in .png or .pdf or .svg"),
        ("run", "expected a file that ends in .png or .pdf or .svg"),
        ("file/run.png", "its folder cannot be made: File exists"),
        ("folder.png", "cannot be written: Is a directory"),
    ],
)
def test_a_picture_that_cannot_be_written_is_one_line(tmp_path: Path, name: str, line: str) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(PictureError) as caught:
        picture(tmp_path / name)
    assert str(caught.value) == f"{tmp_path / name}: {line}"


def test_an_mp4_without_ffmpeg_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(PictureError) as caught:
        animate_run(tmp_path / "run.mp4", VIEW)
    assert str(caught.value) == f"{tmp_path / 'run.mp4'}: an .mp4 needs ffmpeg, which is not installed; choose a .gif"


def test_an_ffmpeg_that_fails_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ffmpeg = tmp_path / "ffmpeg"
    ffmpeg.write_text("#!/bin/sh\necho 'no room' >&2\nexit 1\n")
    ffmpeg.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    with pytest.raises(PictureError) as caught:
        animate_run(tmp_path / "run.mp4", VIEW)
    assert str(caught.value) == f"{tmp_path / 'run.mp4'}: ffmpeg failed: no room"


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_an_mp4_is_written_where_there_is_ffmpeg(tmp_path: Path) -> None:
    path = animate_run(tmp_path / "run.mp4", VIEW, fps=10, speed_up=1.0)
    assert b"ftyp" in path.read_bytes()[:16]


def test_without_matplotlib_the_reason_is_one_line() -> None:
    hidden = "import sys; sys.modules['matplotlib'] = None; import zwerm.view.stills"
    run = subprocess.run([sys.executable, "-c", hidden], capture_output=True, text=True, check=False)
    assert run.stderr.strip().splitlines()[-1].endswith("pip install matplotlib")
    assert "PictureError: pictures need matplotlib" in run.stderr


def test_drawing_leaves_matplotlibs_global_state_alone() -> None:
    alone = "import sys, zwerm.view.stills; print('matplotlib.pyplot' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", alone], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "False"
