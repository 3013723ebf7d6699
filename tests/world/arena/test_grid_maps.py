"""Grid maps of planning benchmarks: exact outlines, start cells, and one line for each mistake."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from zwerm.errors import ScenarioError
from zwerm.run.assembly import assemble
from zwerm.scenario.load import validate
from zwerm.scenario.tables import ArenaTable
from zwerm.world.arena.grid_maps import read_grid_map
from zwerm.world.arena.shapes import read_shape

ROOMS = ["@@@@@", "@..G@", "@.T.@", "@SW.@", "@@@@@", "@.@@@"]


def text(rows: list[str]) -> str:
    return "\n".join(["type octile", f"height {len(rows)}", f"width {len(rows[0])}", "map", *rows]) + "\n"


def write(folder: Path, rows: list[str], instance: str = "") -> Path:
    (folder / "rooms.map").write_text(text(rows))
    (folder / "rooms.mcpp").write_text(instance)
    return folder


def space(folder: Path, name: str = "rooms.map", **table: Any) -> Polygon:
    free, _ = read_shape(ArenaTable(map=name, **{"resolution_m": 2.0} | table), folder)
    assert isinstance(free, Polygon)
    return free


def test_the_outline_follows_the_cells_exactly(tmp_path: Path) -> None:
    found = space(write(tmp_path, ROOMS))
    cells = [(1, 4), (2, 4), (3, 4), (1, 3), (3, 3), (1, 2), (3, 2)]
    expected = np.array([box(2 * x, 2 * y, 2 * x + 2, 2 * y + 2) for x, y in cells])
    assert found.area == 4.0 * len(cells)
    assert all(found.contains(cell) for cell in expected)
    assert found.bounds == (2.0, 4.0, 8.0, 10.0)


def test_a_start_chooses_the_room(tmp_path: Path) -> None:
    write(tmp_path, ROOMS)
    assert space(tmp_path, start=(3.0, 1.0)).equals(box(2.0, 0.0, 4.0, 2.0))
    with pytest.raises(ScenarioError, match=r"arena.start: expected a place in the map's free space"):
        space(tmp_path, start=(0.5, 1.0))


def test_cells_that_touch_at_a_corner_are_apart(tmp_path: Path) -> None:
    assert space(write(tmp_path, ["..@", "@@."])).area == 8.0


@pytest.mark.parametrize("root", ["[[1, 1], [3, 2]]", "[7, 20]"], ids=["column-and-row", "number"])
def test_an_instance_names_the_map_and_the_start_cells(tmp_path: Path, root: str) -> None:
    write(tmp_path, ROOMS, f"map: rooms\nroot: {root}\nweighted: True\nincomplete: False\n")
    assert read_grid_map(tmp_path / "rooms.mcpp").roots == ((1, 1), (2, 3))
    assert space(tmp_path, "rooms.mcpp").equals(space(tmp_path))


def scenario(folder: Path, count: int, **placement: Any) -> Any:
    table = {
        "name": "grid",
        "arena": {"map": "rooms.mcpp", "resolution_m": 2.0, "scale": 0.5},
        "robots": {
            "count": count,
            "controller": "beacon",
            "body": {"radius_m": 0.2},
            "placement": {"kind": "roots", **placement},
        },
    }
    return validate(table, "grid.toml", folder)


def test_robots_start_in_the_start_cells(tmp_path: Path) -> None:
    write(tmp_path, ROOMS, "map: rooms\nroot: [[1, 1], [3, 2]]\n")
    world = assemble(scenario(tmp_path, 2), 1)
    assert world.scene.position.tolist() == [[1.5, 4.5], [3.5, 3.5]]
    with pytest.raises(ScenarioError, match=r"robots.placement.kind: rooms.mcpp has 2 start cells, got 3 robots"):
        assemble(scenario(tmp_path, 3), 1)


def test_a_map_in_the_folder_of_grid_maps_is_found(tmp_path: Path) -> None:
    (tmp_path / "gridmaps").mkdir()
    (tmp_path / "instances").mkdir()
    write(tmp_path / "gridmaps", ROOMS)
    path = tmp_path / "instances" / "one.mcpp"
    path.write_text("map: rooms\nroot: [[1, 1]]\n")
    assert read_grid_map(path).free.sum() == 8


@pytest.mark.parametrize(
    ("content", "mistake"),
    [
        ("type octile\nheight 1\n", "expected the lines type, height, width and map first"),
        ("type octile\nheight x\nwidth 1\nmap\n.\n", "line 2: expected height and a number > 0, got 'height x'"),
        ("type octile\nheight 2\nwidth 1\nmap\n.\n", "expected 2 rows, got 1"),
        ("type octile\nheight 1\nwidth 2\nmap\n.\n", "line 5: expected 2 cells, got 1"),
        ("type octile\nheight 1\nwidth 1\nmap\nx\n", "line 5: expected cells of .GS@OTW, got 'x'"),
        ("type octile\nheight 1\nwidth 1\nmap\n@\n", "expected at least one free cell, got none"),
        ("type octile\nheight 9999\nwidth 9999\nmap\n", "expected at most 4000000 cells, got 99980001"),
        ("type öctile\n", "cannot be read as ASCII text"),
    ],
)
def test_a_mistake_in_a_map_is_one_line(tmp_path: Path, content: str, mistake: str) -> None:
    (tmp_path / "rooms.map").write_text(content, encoding="utf-8")
    with pytest.raises(ScenarioError) as raised:
        space(tmp_path)
    assert raised.value.mistakes == [f"arena.map: {tmp_path / 'rooms.map'}: {mistake}"]


@pytest.mark.parametrize(
    ("instance", "mistake"),
    [
        ("root: [[1, 1]]", "map: missing"),
        ("map: rooms", "root: missing"),
        ("map: [", "cannot be read as YAML"),
        ("map: other\nroot: [[1, 1]]", "map: no such file, got other.map"),
        ("map: rooms\nroot: [[0, 0]]", "root: expected free cells, got [0, 0]"),
        ("map: rooms\nroot: [[1, 99]]", "root: expected free cells, got [1, 99]"),
        ("map: rooms\nroot: [a]", "root: expected [column, row] for each robot, got 'a'"),
    ],
)
def test_a_mistake_in_an_instance_is_one_line(tmp_path: Path, instance: str, mistake: str) -> None:
    write(tmp_path, ROOMS, instance)
    with pytest.raises(ScenarioError) as raised:
        space(tmp_path, "rooms.mcpp")
    assert raised.value.mistakes == [f"arena.map: {tmp_path / 'rooms.mcpp'}: {mistake}"]


def test_a_grid_map_needs_the_size_of_a_cell(tmp_path: Path) -> None:
    write(tmp_path, ROOMS)
    with pytest.raises(ScenarioError, match="a grid map needs resolution_m"):
        space(tmp_path, resolution_m=None)
