"""The stages of a deployment: a swarm's simplicial complex as it was told, cycle by cycle, or as it truly is; for pictures.

What is told is for those who watch (see `Command.told`): `complex` is a table with the `cycle`, and by ids of robots the
`edges`, those among them that are `frontier` or `obstacle`, and the `path` to push along or several `paths`.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from zwerm.maths.keyed_random import Draws
from zwerm.maths.simplicial import FlagComplex
from zwerm.world.arena.arena import Arena
from zwerm.world.geometry.visibility import Visibility
from zwerm.world.scene import Bools, Floats, Ints, Scene
from zwerm.world.tick.telemetry import TelemetryRecord


class Snapshot(NamedTuple):
    """The complex at one cycle, and where the robots stood then. The true one belongs to no cycle."""

    cycle: int | None
    time_s: float
    position: Floats  # (n, 2) [m]
    present: Bools  # (n,)
    edges: Ints  # (k, 2) robots; likewise the next two
    frontier: Ints
    obstacle: Ints
    paths: tuple[tuple[int, ...], ...]  # each from its source to the robot that goes ahead

    @property
    def triangles(self) -> Ints:
        """(k, 3) the robots of the 2-simplices."""
        lists: dict[int, list[int]] = {robot: [] for robot in np.unique(self.edges).tolist()}
        for i, j in self.edges.tolist():
            lists[i].append(j)
            lists[j].append(i)
        return np.array(FlagComplex(lists).triangles, dtype=np.int64).reshape(-1, 3)


def stages(told: Sequence[TelemetryRecord]) -> list[Snapshot]:
    """Return the stages that were told of, in order."""
    return [_stage(each, each.told["complex"]) for each in told if "complex" in each.told]


def true_stage(time_s: float, position: Floats, standing: Bools, arena: Arena, range_m: float) -> Snapshot:
    """Return the complex of the robots `standing` (n,) at position (n, 2) that see each other within a range [m].

    What they would take for frontier, and where they push, the truth does not tell.
    """
    still = np.zeros(len(standing), dtype=np.bool_)
    scene = Scene(0, time_s, position, still.astype(np.float64), standing, still, 0.0, arena, Draws(0))
    none = np.zeros((0, 2), dtype=np.int64)
    return Snapshot(None, time_s, position, standing, Visibility().pairs(scene, range_m), none, none, ())


def _stage(moment: TelemetryRecord, told: dict[str, Any]) -> Snapshot:
    edges, frontier, obstacle = (
        np.array(told[name], dtype=np.int64).reshape(-1, 2) for name in ("edges", "frontier", "obstacle")
    )
    paths = tuple(tuple(path) for path in told["paths"] if path)
    return Snapshot(told["cycle"], moment.time_s, moment.position, moment.present, edges, frontier, obstacle, paths)
