"""Maps become arenas: which cells are free by the rules of each format, and the treatment of staircases of pixels."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy import ndimage
from shapely.geometry import Polygon

from zwerm.errors import ScenarioError
from zwerm.scenario.tables import ArenaTable
from zwerm.world.arena.arena import Arena
from zwerm.world.arena.raster import component, outline

# Real maps are not part of the project; where they lie beside it they are loaded too.
REAL_MAPS = Path(os.environ.get("ZWERM_MAPS", Path(__file__).parents[4] / "shared" / "maps"))

FREE, UNKNOWN, WALL = 254, 205, 0
TRINARY = {
    "image": "room.pgm",
    "resolution": 0.05,
    "origin": [-1.0, -2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def read(folder: Path, /, **table: Any) -> Arena:
    return Arena.from_table(ArenaTable(**table), folder)


def write_pgm(path: Path, pixels: np.ndarray[Any, Any], plain: bool = False) -> None:
    height, width = pixels.shape
    header = f"{'P2' if plain else 'P5'}\n# drawn by a test\n{width} {height}\n255\n"
    body = "\n".join(" ".join(map(str, row)) for row in pixels).encode() if plain else pixels.astype(np.uint8).tobytes()
    path.write_bytes(header.encode() + body)


def write_yaml(path: Path, **changes: Any) -> None:
    entries = {key: value for key, value in (TRINARY | changes).items() if value is not None}
    path.write_text(yaml.safe_dump(entries))


def room() -> np.ndarray[Any, Any]:
    """Unknown around walls around a room of 20 x 10 free cells with a pillar of 2 x 3; a free speck in the unknown."""
    pixels = np.full((16, 30), UNKNOWN)
    pixels[2:14, 3:25] = WALL
    pixels[3:13, 4:24] = FREE
    pixels[5:8, 10:12] = WALL
    pixels[0, 29] = FREE
    return pixels


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_pgm(tmp_path / "room.pgm", room())
    write_yaml(tmp_path / "room.yaml")
    return tmp_path


def assert_is_the_room(arena: Arena) -> None:
    # 4 columns left of the room and 3 rows below it; the pillar 6 columns from its left and 2 rows from its top
    expected = shapely.box(-0.8, -1.85, 0.2, -1.35) - shapely.box(-0.5, -1.6, -0.4, -1.45)
    assert arena.free.symmetric_difference(expected).area < 1e-12
    assert len(arena.segments) == 8


def test_a_ros_map_lies_at_its_origin_and_unknown_cells_are_not_free(folder: Path) -> None:
    assert_is_the_room(read(folder, map="room.yaml"))


def test_a_plain_pgm_gives_the_same_cells_as_a_binary_one(folder: Path) -> None:
    write_pgm(folder / "room.pgm", room(), plain=True)
    assert_is_the_room(read(folder, map="room.yaml"))


def test_a_negated_png_gives_the_same_cells(folder: Path) -> None:
    Image.fromarray((255 - room()).astype(np.uint8)).save(folder / "room.png")
    write_yaml(folder / "room.yaml", image="room.png", negate=1)
    assert_is_the_room(read(folder, map="room.yaml"))


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P", "I;16"])
def test_an_image_may_have_colours_a_palette_opacity_or_sixteen_bits(folder: Path, mode: str) -> None:
    if mode == "I;16":
        image = Image.fromarray((room() * 257).astype(np.uint16))
    else:
        image = Image.fromarray(room().astype(np.uint8)).convert(mode)
    assert image.mode == mode
    image.save(folder / "room.png")
    # In a trinary map opacity counts as a fourth channel of brightness, so that opaque grey 205 is 0.147 occupied.
    write_yaml(folder / "room.yaml", image="room.png", free_thresh=0.1 if mode == "RGBA" else 0.196)
    assert_is_the_room(read(folder, map="room.yaml"))


def test_the_free_threshold_decides_whether_map_savers_grey_is_free(folder: Path) -> None:
    write_yaml(folder / "room.yaml", free_thresh=0.25)  # grey 205 is occupied to (255 - 205) / 255 = 0.196
    outside = 16 * 30 - 12 * 22
    assert read(folder, map="room.yaml").area_m2 == pytest.approx(outside * 0.05**2, rel=0.01)


def test_in_raw_mode_a_pixel_is_a_percentage(folder: Path) -> None:
    pixels = np.where(room() == FREE, 10, np.where(room() == WALL, 100, 255))
    write_pgm(folder / "room.pgm", pixels)
    write_yaml(folder / "room.yaml", mode="raw")
    assert_is_the_room(read(folder, map="room.yaml"))


def test_in_scale_mode_a_transparent_pixel_is_unknown(folder: Path) -> None:
    white = np.where(room() == WALL, 0, 255)
    opacity = np.where(room() == UNKNOWN, 0, 255)
    Image.fromarray(np.stack([white] * 3 + [opacity], axis=-1).astype(np.uint8)).save(folder / "room.png")
    write_yaml(folder / "room.yaml", image="room.png", mode="scale")
    assert_is_the_room(read(folder, map="room.yaml"))


def test_a_turned_map_is_turned_about_its_origin(folder: Path) -> None:
    straight = read(folder, map="room.yaml").free
    write_yaml(folder / "room.yaml", origin=[-1.0, -2.0, 0.5])
    turned = read(folder, map="room.yaml", start=(-0.45, -1.13)).free  # 0.9 m and 0.5 m along the turned sides
    expected = shapely.affinity.rotate(straight, 0.5, origin=(-1.0, -2.0), use_radians=True)
    assert turned.symmetric_difference(expected).area < 1e-12


def test_scale_multiplies_a_maps_lengths(folder: Path) -> None:
    assert read(folder, map="room.yaml", scale=2.0).bounds == pytest.approx((-1.6, -3.7, 0.4, -2.7))


def test_a_bitmap_has_dark_walls_and_is_measured_by_its_resolution_or_stretched_to_a_size(tmp_path: Path) -> None:
    pixels = np.full((10, 20), 200, dtype=np.uint8)
    pixels[:4] = 90  # the upper rows
    Image.fromarray(pixels).save(tmp_path / "half.bmp")
    assert read(tmp_path, map="half.bmp", resolution_m=0.1).bounds == pytest.approx((0, 0, 2, 0.6))
    assert read(tmp_path, map="half.bmp", size_m=(40, 10)).bounds == pytest.approx((0, 0, 40, 6))


def test_transparent_pixels_of_a_bitmap_are_seen_on_white(tmp_path: Path) -> None:
    pixels = np.zeros((4, 4, 4), dtype=np.uint8)
    pixels[:, 2:, 3] = 255
    Image.fromarray(pixels).save(tmp_path / "half.png")
    assert read(tmp_path, map="half.png", resolution_m=1).bounds == (0, 0, 2, 4)


def test_the_largest_part_of_a_map_is_kept_or_the_one_with_the_start_in_it(tmp_path: Path) -> None:
    pixels = np.full((5, 9), 255, dtype=np.uint8)
    pixels[:, 3] = 0
    Image.fromarray(pixels).save(tmp_path / "two.png")
    assert read(tmp_path, map="two.png", resolution_m=1).bounds == (4, 0, 9, 5)
    assert read(tmp_path, map="two.png", resolution_m=1, start=(1.5, 2.5)).bounds == (0, 0, 3, 5)


def test_obstacles_and_thin_walls_go_on_top_of_a_map(folder: Path) -> None:
    bare = read(folder, map="room.yaml")
    corner = [(-0.8, -1.85), (-0.6, -1.85), (-0.6, -1.75), (-0.8, -1.75)]
    arena = read(folder, map="room.yaml", obstacles=[corner], walls=[[(0.0, -1.8), (0.0, -1.4)]])
    assert arena.area_m2 == pytest.approx(bare.area_m2 - 0.02)
    assert arena.blocked(np.array([[-0.1, -1.6]]), np.array([[0.1, -1.6]])).all()


@st.composite
def bitmaps(draw: Any) -> np.ndarray[Any, Any]:
    """Free cells of every kind: noise from fine to blotchy."""
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    height, width = draw(st.tuples(st.integers(1, 40), st.integers(1, 40)))
    noise = ndimage.gaussian_filter(random.normal(size=(height, width)), draw(st.sampled_from([0.0, 0.7, 2.0])))
    free = noise > np.quantile(noise, draw(st.sampled_from([0.05, 0.3, 0.6])))
    free[0, 0] = True
    return free


@settings(deadline=None, max_examples=50)
@given(free=bitmaps())
def test_an_outline_is_valid_keeps_every_hole_and_moves_by_less_than_a_pixel(free: Any) -> None:
    kept = component(free)
    rows, columns = np.nonzero(kept)
    exact = shapely.union_all(shapely.box(columns, rows, columns + 1, rows + 1))
    drawn = outline(kept)
    assert drawn.is_valid
    assert shapely.hausdorff_distance(drawn.boundary, exact.boundary, densify=0.25) < 1.0
    _, regions = ndimage.label(np.pad(~kept, 1, constant_values=True), structure=np.ones((3, 3)))
    assert len(drawn.interiors) == regions - 1  # walls that touch at a corner hang together


@settings(deadline=None, max_examples=50)
@given(rows=st.lists(st.integers(2, 37), min_size=2, max_size=6), upside=st.booleans())
def test_a_wall_one_pixel_thin_lets_no_sight_through_however_it_winds(rows: list[int], upside: bool) -> None:
    size = 40
    column = np.arange(1, size)  # the first column is left open, so that both sides are one component
    row = np.round(np.interp(column, np.linspace(1, size - 1, len(rows)), rows)).astype(int)
    free = np.ones((size, size), dtype=np.bool_)
    free[row, column] = False
    for at, (low, high) in enumerate(zip(np.minimum(row[1:], row[:-1]), np.maximum(row[1:], row[:-1]), strict=True)):
        free[low + 1 : high, column[at]] = False  # from one pixel to the next the wall goes on by a corner at least
    kept = component(free[::-1] if upside else free)
    arena = Arena(outline(kept))
    above, below = np.array([[[x + 0.5, y] for x in column] for y in (size - 0.5, 0.5)])
    assert arena.contains(np.vstack([above, below])).all()
    assert arena.blocked(above, below).all()
    assert not arena.blocked(np.array([[0.5, size - 0.5]]), np.array([[0.5, 0.5]])).any()


def test_a_straight_staircase_becomes_one_line_and_a_rectangle_stays_exact() -> None:
    triangle = np.arange(60)[None, :] >= np.arange(60)[:, None]
    slant = shapely.LineString([(1, 1.5), (59, 59.5)])
    drawn = Arena(outline(triangle))
    assert slant.distance(drawn.free.boundary) < 1e-12
    assert len(drawn.segments) <= 4
    assert outline(np.ones((3, 5), dtype=np.bool_)).equals(shapely.box(0, 0, 5, 3))


BROKEN = {
    "missing image": ({"image": "none.pgm"}, "image: no such file, got none.pgm"),
    "missing key": ({"free_thresh": None}, "free_thresh: required, and missing"),
    "resolution 0": ({"resolution": 0}, "resolution: expected > 0, got 0"),
    "short origin": ({"origin": [0, 0]}, "origin: expected 3 items, got [0, 0]"),
    "mode": ({"mode": "exact"}, 'mode: expected "trinary", "scale" or "raw", got "exact"'),
    "negate": ({"negate": 2}, "negate: expected <= 1, got 2"),
    "thresholds": (
        {"free_thresh": 0.7},
        "free_thresh: expected at most occupied_thresh, got 0.7 > 0.65",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_every_mistake_in_a_ros_map_is_one_line(folder: Path, case: str) -> None:
    changes: Any
    changes, line = BROKEN[case]
    path = folder / "room.yaml"
    write_yaml(path, **changes)
    with pytest.raises(ScenarioError) as caught:
        read(folder, map="room.yaml")
    assert caught.value.mistakes == [f"arena.map: {path}: {line}"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("image: [room.pgm", "not YAML: expected ',' or ']', but got '<stream end>' in line 1"),
        ("image: \x00", "not YAML: expected text"),
        ("- image", "expected keys and values, got list"),
        ("", "expected keys and values, got NoneType"),
    ],
)
def test_a_file_that_is_no_yaml_table_is_one_line(folder: Path, text: str, line: str) -> None:
    path = folder / "room.yaml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        read(folder, map="room.yaml")
    assert caught.value.mistakes == [f"arena.map: {path}: {line}"]


def test_a_ros_map_takes_no_other_size_and_all_mistakes_are_reported(folder: Path) -> None:
    path = folder / "room.yaml"
    write_yaml(path, resolution=-1, free_thresh=2)
    with pytest.raises(ScenarioError) as caught:
        read(folder, map="room.yaml", resolution_m=0.1, size_m=(3, 3), obstacles=[[(0, 0), (1, 1), (1, 0), (0, 1)]])
    assert caught.value.mistakes == [
        "arena.resolution_m: a ROS map has its own resolution, got 0.1",
        "arena.size_m: a ROS map has its own resolution, got (3.0, 3.0)",
        f"arena.map: {path}: resolution: expected > 0, got -1",
        f"arena.map: {path}: free_thresh: expected <= 1, got 2",
        "arena.obstacles.0: expected a simple polygon, got self-intersection at (0.5, 0.5)",
    ]


def test_a_start_within_a_wall_is_one_line(folder: Path) -> None:
    for start in ((-0.45, -1.5), (50.0, 0.0)):
        with pytest.raises(ScenarioError) as caught:
            read(folder, map="room.yaml", start=start)
        assert caught.value.mistakes == [f"arena.start: expected a place in the map's free space, got {start}"]


def test_a_map_without_a_free_cell_is_one_line(folder: Path) -> None:
    write_pgm(folder / "room.pgm", np.full((4, 4), UNKNOWN))
    with pytest.raises(ScenarioError) as caught:
        read(folder, map="room.yaml")
    assert caught.value.mistakes == [f"arena.map: {folder / 'room.yaml'}: expected at least one free cell, got none"]


@pytest.mark.parametrize("sizes", [{}, {"resolution_m": 0.1, "size_m": (1, 1)}])
def test_a_bitmap_needs_exactly_one_size(folder: Path, sizes: Any) -> None:
    with pytest.raises(ScenarioError) as caught:
        read(folder, map="room.pgm", **sizes)
    got = "resolution_m and size_m" if sizes else "neither"
    rule = "a bitmap needs exactly one of resolution_m and size_m"
    assert caught.value.mistakes == [f"arena.map: {folder / 'room.pgm'}: {rule}, got {got}"]


@pytest.mark.parametrize("broken", ["cut short", "no image", "empty"])
def test_a_broken_image_is_one_line(tmp_path: Path, broken: str) -> None:
    path = tmp_path / "room.png"
    Image.fromarray(room().astype(np.uint8)).save(path)
    whole = path.read_bytes()
    path.write_bytes({"cut short": whole[: len(whole) // 2], "no image": b"not an image", "empty": b""}[broken])
    with pytest.raises(ScenarioError) as caught:
        read(tmp_path, map="room.png", resolution_m=0.1)
    assert caught.value.mistakes == [f"arena.map: {path}: expected a whole image (PGM, PNG, BMP, ...)"]


@pytest.mark.skipif(
    not REAL_MAPS.is_dir(), reason=f"there are no real maps at {REAL_MAPS} (ZWERM_MAPS names the place)"
)
@pytest.mark.parametrize(
    ("table", "size_m", "area_m2", "within"),
    [
        ({"map": "nav2/depot.yaml"}, (30.2, 15.35), 436.7, (0.0, 0.0)),
        ({"map": "nav2/tb3_sandbox.yaml"}, (5.45, 5.1), 19.7, (-2.0, -0.5)),
        ({"map": "stage/cave.png", "size_m": (16, 16)}, (16.0, 16.0), 195.5, (1.0, 1.0)),
        ({"map": "stage/simple_rooms.png", "resolution_m": 0.05}, (18.2, 13.45), 208.0, (10.0, 7.5)),
    ],
    ids=["depot", "tb3_sandbox", "cave", "simple_rooms"],
)
def test_real_maps_become_arenas(table: Any, size_m: Any, area_m2: float, within: Any) -> None:
    arena = read(REAL_MAPS, **table)
    xmin, ymin, xmax, ymax = arena.bounds
    assert (xmax - xmin, ymax - ymin) == pytest.approx(size_m, abs=0.06)
    assert arena.area_m2 == pytest.approx(area_m2, rel=0.01)
    assert isinstance(arena.free, Polygon)
    assert arena.free.is_valid
    assert arena.contains(np.array([within]), 0.1).all()
    assert len(arena.segments) < 2500
