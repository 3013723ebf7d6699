"""Landmark exploration of drawn buildings: whether `completed` is true, and how much of the building is mapped.

The seed draws the building (`tests/helpers/random_buildings.py`, scaled to `--area` square ranges of sight), the landmarks and
the places of the robots. A run is *right* if it is `completed` with a completion of at least 0.9. It is *false* if it is
`completed` with less, or where a robot concluded while a living one knew an open frontier. Every other run ended at the
time limit, or failed.

    python -m benchmarks.algorithms.bench_landmark_buildings --rows rows.csv --seeds 1 3
    python -m benchmarks.algorithms.bench_landmark_buildings --map depot.yaml --set arena.resolution_m=0.05

With `--rows FILE` each run is stored when it ends, and runs that are stored are not repeated. `--map` runs a map instead.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from statistics import mean
from typing import Final

import msgspec

from benchmarks.common.campaign import add_campaign_options, carry_out, grouped
from benchmarks.common.csv_rows import write_csv
from tests.helpers.random_buildings import KINDS, random_building
from zwerm import run

ENOUGH: Final = 0.9
ROBOTS: Final = 8
VARIANTS: Final = {"central": (), "decentralised": ("services.map=gossip", "services.assignment=claims")}


class Case(msgspec.Struct, frozen=True):
    """One run: its variant, the kind of its building or its map, and its seed."""

    variant: str
    building: str
    seed: str


def cases(asked: argparse.Namespace) -> Iterator[Case]:
    """Yield the runs that are asked for, with the seed as the slowest index."""
    for seed in range(asked.seeds[0], asked.seeds[1] + 1):
        for building in asked.map or asked.kind:
            for variant in asked.variant:
                yield Case(variant, building, str(seed))


def one_run(case: Case, area: float, more: Sequence[str]) -> dict[str, str]:
    """Carry out one run, and return its row."""
    source = f'map="{case.building}"'
    if case.building in KINDS:
        source = f'wkt="{random_building(case.building, int(case.seed))}"'
    settings = [
        f"arena={{{source}, free_area_m2={area}, passage_m=0.1}}",
        f"robots.count={ROBOTS}",
        f"robots.parameters.robots_expected={ROBOTS}",
        *VARIANTS[case.variant],
        *more,
    ]
    began = time.process_time()
    result = run("landmark-map", seed=int(case.seed), runner="inline", overrides=settings)
    found = result.metrics
    completed = found.get("completion_fraction", 0.0)
    early = found.get("concluded_early", 0.0)
    return {
        **msgspec.structs.asdict(case),
        "verdict": ("right" if completed >= ENOUGH and not early else "false")
        if result.outcome == "completed"
        else result.outcome,
        "completion": f"{completed:.4f}",
        "iterations": str(result.ticks),
        "landmarks": f"{found.get('landmarks', 0.0):g}",
        "holes": f"{found.get('landmark_complex_holes', 0.0):g}",
        "obstacles": f"{found.get('obstacles', 0.0):g}",
        "open_frontiers": f"{found.get('open_frontiers', 0.0):g}",
        "concluded_early": f"{early:g}",
        "tracebacks": str(len(result.tracebacks)),
        "cpu_s": f"{time.process_time() - began:.1f}",
    }


def summary(rows: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """Return one row for each kind of building and variant."""
    return [
        {
            "building": building,
            "variant": variant,
            "runs": str(len(group)),
            "completed": str(sum(row["verdict"] in ("right", "false") for row in group)),
            "completed falsely": str(sum(row["verdict"] == "false" for row in group)),
            "with a traceback": str(sum(row["tracebacks"] != "0" for row in group)),
            "completion": f"{mean(float(row['completion']) for row in group):.3f}",
            "least completion": min(row["completion"] for row in group),
            "holes equal obstacles": str(sum(row["holes"] == row["obstacles"] for row in group)),
            "iterations": f"{mean(float(row['iterations']) for row in group):.0f}",
        }
        for (building, variant), group in sorted(grouped(rows, "building", "variant").items())
    ]


def main() -> None:
    """Run every kind of building with every seed, and print a row each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variant", choices=VARIANTS, nargs="+", default=list(VARIANTS))
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=list(KINDS))
    parser.add_argument("--map", nargs="+", metavar="FILE", help="maps instead of drawn buildings")
    parser.add_argument("--area", type=float, default=60.0, help="free area in square ranges of sight")
    add_campaign_options(parser, last_seed=3)
    asked = parser.parse_args()
    rows = carry_out(asked, cases(asked), lambda case: one_run(case, asked.area, asked.set))
    write_csv(asked.csv, summary(rows))


if __name__ == "__main__":
    main()
