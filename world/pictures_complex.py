"""Pictures of a swarm's simplicial complex: triangles, frontier, obstacle edges and the path to push along, at any cycle.

They show the truth's positions and the complex as the coordinator told it at that moment (what it told is for those who
watch, see `Command.told`). Frontier is cyan and obstacle brown, as in Ramaithitima et al. 2015. Importing this module
needs matplotlib, which comes with the `study` extra.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from zwerm.errors import PictureError
from zwerm.simplicial import FlagComplex
from zwerm.world.arena import Arena
from zwerm.world.scene import Floats
from zwerm.world.sight import sight_coverage_fraction
from zwerm.world.told import Told

try:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
except ImportError as missing:
    raise PictureError(f"pictures need matplotlib ({missing}): pip install 'zwerm[study]'") from None

FRONTIER, OBSTACLE, PATH, INNER = "#00b7c7", "#8c5a2b", "#d62728", "#9aa5a0"


def cycles(told: Sequence[Told]) -> list[Told]:
    """Return what was told of the complex, one a cycle, in order."""
    return [each for each in told if "complex" in each.told]


def draw_complex(path: Path, arena: Arena, moment: Told, title: str = "", names: bool = True) -> Path:
    """Draw the complex at one moment at `path`, and return the path. `names` writes the robots' ids beside them.

    Raises PictureError where the file cannot be written.
    """
    xmin, ymin, xmax, ymax = arena.bounds
    figure = Figure(figsize=(9.0, 9.0 * max(0.3, (ymax - ymin) / (xmax - xmin)) + 0.5), layout="tight")
    axes = figure.add_subplot()
    _draw(axes, arena, moment.position, moment.told["complex"], names)
    axes.set_title(title or f"cycle {moment.told['complex']['cycle']}, {moment.time_s:.1f} s", fontsize=10)
    return _save(figure, path)


def draw_coverage(path: Path, arena: Arena, told: Sequence[Told], range_m: float, points: int = 40) -> Path:
    """Plot the fraction of the arena in sight against cycles, at some `points` of them, and return the path."""
    moments = cycles(told)
    chosen = moments[:: max(1, len(moments) // points)]
    fractions = [
        sight_coverage_fraction(each.position[_robots(each.told["complex"])], range_m, arena) for each in chosen
    ]
    figure = Figure(figsize=(6.0, 3.5), layout="tight")
    axes = figure.add_subplot()
    axes.plot([each.told["complex"]["cycle"] for each in chosen], fractions)
    axes.set(xlabel="deployment cycles", ylabel="fraction of the arena in sight", ylim=(0.0, 1.02))
    axes.grid(alpha=0.3)
    return _save(figure, path)


def _robots(told: dict[str, Any]) -> list[int]:
    return sorted({robot for each in told["edges"] for robot in each} | {0})


def _draw(axes: Axes, arena: Arena, position: Floats, told: dict[str, Any], names: bool) -> None:
    robots = _robots(told)
    lists: dict[int, list[int]] = {robot: [] for robot in robots}
    for i, j in told["edges"]:
        lists[i].append(j)
        lists[j].append(i)
    triangles = [position[list(each)] for each in FlagComplex(lists).triangles]
    axes.add_collection(PolyCollection(triangles, facecolors="#cfe8d5", edgecolors="none", zorder=1))
    for edges, colour, width in (
        (told["edges"], INNER, 0.7),
        (told["obstacle"], OBSTACLE, 2.2),
        (told["frontier"], FRONTIER, 2.2),
        (list(zip(told["path"], told["path"][1:], strict=False)), PATH, 1.6),
    ):
        lines = [position[list(each)] for each in edges]
        axes.add_collection(LineCollection(lines, colors=colour, linewidths=width, zorder=2))
    axes.add_collection(
        LineCollection(list(arena.segments.reshape(-1, 2, 2)), colors="black", linewidths=1.2, zorder=3)
    )
    here = position[np.array(robots)]
    axes.plot(here[:, 0], here[:, 1], "o", color="#333333", markersize=3.0, zorder=4)
    if names:
        for robot in robots:
            axes.annotate(str(robot), position[robot], textcoords="offset points", xytext=(3, 3), fontsize=6)
    axes.set_aspect("equal")
    axes.autoscale_view()


def _save(figure: Figure, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        figure.savefig(path, dpi=110)
    except OSError as error:
        raise PictureError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path
