"""The user's choices for pictures: size, words, colours by telemetry, and radio links."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from zwerm.errors import PictureError
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.view.canvas import Sheet
from zwerm.view.layers.telemetry_colours import TelemetryColours
from zwerm.view.picture_style import PictureStyle
from zwerm.world.tick.telemetry import TelemetryArrays

# Two pairs, each out of reach of the other: 0 and 1 on the left, 2 and 3 on the right.
POSES = "[[0.3,1.0,0.0],[0.7,1.0,0.0],[1.3,1.0,0.0],[1.7,1.0,0.0]]"


@pytest.fixture(scope="module")
def pairs() -> RunResult:
    settings = [
        "robots.count=4",
        "arena.size_m=[2.0,2.0]",
        f"robots.placement={{kind='poses',poses={POSES}}}",
        "radio={range_m=0.5}",
        "time.duration_s=2.0",
        "robots.parameters.done_at=99",
    ]
    return run("gossip-max", 1, "inline", settings)


def colour_at(picture: Path, x_m: float, y_m: float) -> tuple[int, ...]:
    """Return the colour at a place of a bare picture whose arena is 2 m by 2 m."""
    with Image.open(picture) as opened:
        image = np.asarray(opened.convert("RGB"))
    dark = (image == (0x22, 0x22, 0x22)).all(axis=2)
    # The walls are the longest dark lines.
    rows, columns = np.flatnonzero(dark.sum(axis=1) > 300), np.flatnonzero(dark.sum(axis=0) > 300)
    left, right, top, bottom = columns[0], columns[-1], rows[0], rows[-1]
    return tuple(map(int, image[round(bottom - (bottom - top) * y_m / 2.0), round(left + (right - left) * x_m / 2.0)]))


def rgb(colour: str) -> tuple[int, ...]:
    return tuple(int(colour[start : start + 2], 16) for start in (1, 3, 5))


def test_robots_have_the_colour_of_what_they_have_reported_at_that_time(pairs: RunResult, tmp_path: Path) -> None:
    least, greatest = rgb(TelemetryColours.colours[0]), rgb(TelemetryColours.colours[-1])
    start = pairs.picture(tmp_path / "start.png", at_s=0.0, bare=True, links=False)
    end = pairs.picture(tmp_path / "end.png", bare=True, links=False)
    # Beside the centre: a line there shows the heading.
    assert colour_at(start, 0.29, 0.985) == least  # robot 0 knows 0
    assert colour_at(end, 0.29, 0.985) == rgb(TelemetryColours.colours[2])  # it has heard of 1, the largest of its pair
    assert colour_at(start, 1.69, 0.985) == colour_at(end, 1.29, 0.985) == greatest  # 3, the largest of all


def test_links_connect_robots_between_which_a_packet_has_arrived(pairs: RunResult, tmp_path: Path) -> None:
    assert pairs._links() == [(0, 1), (2, 3)]
    shown = pairs.picture(tmp_path / "links.png", bare=True)
    hidden = pairs.picture(tmp_path / "none.png", bare=True, links=False)
    assert colour_at(shown, 0.55, 1.0) != colour_at(hidden, 0.55, 1.0) == (255, 255, 255)
    assert colour_at(shown, 1.0, 1.0) == (255, 255, 255)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([0.0, 1.0, 1.0], ["x is 0", "x is 1"]),
        ([2.0, 2.0, 2.0], ["x is 2"]),
        ([0.0, 1.0, 9.0], ["x is 0", "x is 1", "x is 9"]),
        ([0.0, 1.0, 2.0, 10.0], ["x is 0", "x is 5", "x is 10"]),
    ],
)
def test_the_legend_names_values_that_occur_where_there_are_few(
    pairs: RunResult, values: list[float], words: list[str]
) -> None:
    count = len(values)
    told = TelemetryArrays(
        np.arange(count), np.zeros(count), np.zeros(count, int), np.full(count, "x"), np.array(values)
    )
    view = replace(pairs._view(PictureStyle()), telemetry=told, colour_by="x")
    layer = TelemetryColours(Sheet(view.arena, ""), view)
    assert [each.get_label() for each in layer.legend()] == words


def test_telemetry_that_no_robot_reported_is_refused_as_a_colour_in_one_line(pairs: RunResult, tmp_path: Path) -> None:
    with pytest.raises(PictureError) as caught:
        pairs.picture(tmp_path / "a.png", colour_by="larges")
    assert (
        str(caught.value)
        == "colour_by: expected a name of telemetry that the run has (largest), got 'larges'; did you mean largest?"
    )


def test_a_picture_without_the_colours_of_its_scenario_is_drawn_where_no_robot_reported_them(
    pairs: RunResult, tmp_path: Path
) -> None:
    assert (pairs.scenario.pictures.colour_by, pairs.missing_colour) == ("largest", "")
    other = run(
        "gossip-max", 1, "inline", ["robots.controller=refused:Plain", "robots.parameters={}", "time.duration_s=1"]
    )
    assert other.missing_colour == "largest"
    assert other.picture(tmp_path / "plain.png").read_bytes().startswith(b"\x89PNG")


def test_the_arena_in_a_picture_has_the_requested_size(pairs: RunResult, tmp_path: Path) -> None:
    sizes = []
    for side in (2.0, 4.0):
        with Image.open(pairs.picture(tmp_path / "a.png", size_in=(side, 9.0), bare=True)) as image:
            sizes.append(image.size)
    assert sizes[1][0] - sizes[0][0] == pytest.approx(300, abs=2)  # 2 inches more at 150 dots an inch
    assert sizes[1][1] - sizes[0][1] == pytest.approx(300, abs=2)


def test_a_bare_picture_has_no_text_and_an_animation_takes_the_same_options(pairs: RunResult, tmp_path: Path) -> None:
    full = pairs.picture(tmp_path / "full.svg").read_text()
    bare = pairs.picture(tmp_path / "bare.svg", bare=True).read_text()
    assert "gossip-max, seed 1" in full
    assert "packets have arrived" in full
    assert "gossip-max, seed 1" not in bare
    assert "packets have arrived" not in bare
    assert pairs.animate(tmp_path / "a.gif", size_in=(2.0, 2.0), bare=True).read_bytes().startswith(b"GIF89a")
    assert pairs._style(None, False, None, None) == PictureStyle(None, False, "largest", True)
