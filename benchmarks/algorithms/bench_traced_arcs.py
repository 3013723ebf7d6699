"""The arcs that robot teams trace, against the true boundary: how many join two boundaries that are not connected.

An arc is right if the boundary of the body's free space leads from its one end to its other within the slab that it crosses.

    python -m benchmarks.algorithms.bench_traced_arcs --seeds 1 20 --rows arcs.csv
    python -m benchmarks.algorithms.bench_traced_arcs --arenas leaning --robots 2 4 --seeds 1 10
"""

import argparse
from typing import Final

import shapely
from msgspec import Struct
from shapely.geometry import Point, Polygon, box

from benchmarks.algorithms.bench_robot_teams import DRAWN, scenario
from benchmarks.common.campaign import add_campaign_options, carry_out, grouped
from benchmarks.common.csv_rows import write_csv
from tests.helpers.random_arenas import BODY_M, ORIGIN_M, SPACING_M
from zwerm.agents.robot_teams.mapping.facts import TracedArc
from zwerm.agents.robot_teams.robot import TeamRobot
from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.world.drivers.lockstep import LockStep

# Largest distance of a measured end from the true boundary [m].
NEAR_M: Final = 0.1


class Case(Struct, frozen=True):
    """One run."""

    arena: str
    robots: str
    seed: str


def measure(case: Case) -> dict[str, str]:
    """Run a team, and compare the arcs that the first robot knows at the end with the truth."""
    drawn, seed = scenario(case.arena, "none", int(case.robots), int(case.seed)), int(case.seed)
    world = assemble(drawn, seed)
    nodes = {node: Node(*spec) for node, spec in node_specs(drawn, seed).items()}
    link = MemoryLink({node: each.answer for node, each in nodes.items()})
    outcome = LockStep(world, link, [], link).run()
    first = nodes[0]._controller
    assert isinstance(first, TeamRobot)
    arcs = first.map.facts.arcs
    places = world.scene.arena.free.buffer(-BODY_M)
    wrong = sum(not is_right(arc, places) for arc in arcs)
    return {
        "arena": case.arena,
        "robots": case.robots,
        "seed": case.seed,
        "outcome": str(outcome),
        "arcs": str(len(arcs)),
        "wrong_arcs": str(wrong),
        "completion_time_s": f"{world.scene.time_s:.2f}",
    }


def is_right(arc: TracedArc, places: Polygon) -> bool:
    """Return whether the boundary of `places` leads from the arc's one end to its other, within its slab."""
    line_m = [ORIGIN_M + SPACING_M * k for k in (arc.start.slice, arc.start.slice + arc.direction)]
    _, low, _, high = places.bounds
    slab = box(min(line_m) - 0.01, low - 1.0, max(line_m) + 0.01, high + 1.0)
    pieces = shapely.get_parts(shapely.line_merge(places.boundary.intersection(slab)))
    ends = [Point(ORIGIN_M + SPACING_M * end.slice, end.y_mm / 1000.0) for end in (arc.start, arc.stop)]
    return any(all(piece.distance(end) < NEAR_M for end in ends) for piece in pieces)


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Compare the arcs that robot teams trace with the true boundary, over drawn arenas and starts."
    )
    parser.add_argument("--arenas", nargs="+", choices=DRAWN, default=list(DRAWN))
    parser.add_argument("--robots", nargs="+", default=["4"])
    add_campaign_options(parser, 20, settings=False)
    asked = parser.parse_args()
    seeds = range(asked.seeds[0], asked.seeds[1] + 1)
    cases = [Case(arena, robots, str(seed)) for arena in asked.arenas for robots in asked.robots for seed in seeds]
    rows = carry_out(asked, cases, measure)
    summary = [
        {
            "arena": arena,
            "robots": robots,
            "runs": str(len(runs)),
            "completed": str(sum(row["outcome"] == "completed" for row in runs)),
            "traced arcs": str(sum(int(row["arcs"]) for row in runs)),
            "wrong": str(sum(int(row["wrong_arcs"]) for row in runs)),
        }
        for (arena, robots), runs in grouped(rows, "arena", "robots").items()
    ]
    for row in summary:
        print(*row.values(), sep="\t")
    write_csv(asked.csv, summary)


if __name__ == "__main__":
    main()
