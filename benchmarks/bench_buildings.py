"""Sensor coverage in drawn buildings: whether `completed` is true, how much is seen, and what it costs.

The seed draws the building (`tests/random_buildings.py`), the place and the heading of the base, and the noise of
odometry. A run is *right* if it is `completed` with a reachable coverage of at least 0.98, and *false* if it is
`completed` with less. Every other run ended as `failed`, with its reason, or at the time limit.

    python benchmarks/bench_buildings.py --rows rows.csv --seeds 1 5
    python benchmarks/bench_buildings.py --rows rows.csv --kind caves --variant decentralised --noise 0 0.0436332

With `--rows FILE` each run is stored when it ends, and runs that are stored are not repeated.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import mean
from typing import Final

import msgspec
from campaign import add_campaign_options, carry_out
from csv_rows import write_csv

from zwerm import run

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from random_buildings import KINDS, random_building

ENOUGH: Final = 0.98
WELL: Final = 0.99
BODY_M: Final = 0.14
VARIANTS: Final = {"central": (), "decentralised": ("services.path=gradient",)}


class Case(msgspec.Struct, frozen=True):
    """One run: its variant, the kind of its building, the noise of bearings [rad], and its seed."""

    variant: str
    kind: str
    noise_rad: str
    seed: str


def cases(asked: argparse.Namespace) -> Iterator[Case]:
    """Yield the runs that are asked for, with the seed as the slowest index."""
    for seed in range(asked.seeds[0], asked.seeds[1] + 1):
        for noise in asked.noise:
            for kind in asked.kind:
                for variant in asked.variant:
                    yield Case(variant, kind, f"{noise:g}", str(seed))


def one_run(case: Case, more: Sequence[str]) -> dict[str, str]:
    """Carry out one run, and return its row."""
    arena = f'{{wkt="{random_building(case.kind, int(case.seed))}", passage_m={BODY_M}}}'
    settings = [f"arena={arena}", f"robots.sensors.0.sd_rad={case.noise_rad}", *VARIANTS[case.variant], *more]
    began = time.process_time()
    result = run("sensor-coverage-map", seed=int(case.seed), runner="inline", overrides=settings)
    found = result.metrics
    seen = found["reachable_coverage_fraction"]
    completed = "right" if seen >= ENOUGH else "false"
    return {
        **msgspec.structs.asdict(case),
        "verdict": completed if result.outcome == "completed" else result.outcome,
        "reachable_coverage": f"{seen:.4f}",
        "robots": f"{found['robots_deployed']:g}",
        "robots_over_hexagonal": f"{found['robots_over_hexagonal']:.3f}",
        "duration_s": f"{result.sim_s:.1f}",
        "reason": result.reason,
        "cpu_s": f"{time.process_time() - began:.1f}",
    }


def summary(rows: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """Return one row for each variant, kind of building and noise."""
    groups: dict[tuple[str, ...], list[dict[str, str]]] = {}
    for row in rows:
        groups.setdefault((row["variant"], row["kind"], row["noise_rad"]), []).append(row)
    return [
        {
            "variant": variant,
            "building": kind,
            "noise of bearings [rad]": noise,
            "runs": str(len(group)),
            "completed": str(sum(row["verdict"] in ("right", "false") for row in group)),
            "completed falsely": str(sum(row["verdict"] == "false" for row in group)),
            f"coverage of {WELL:g} or more": str(sum(float(row["reachable_coverage"]) >= WELL for row in group)),
            "least coverage": min(row["reachable_coverage"] for row in group),
            "robots over packing": f"{mean(float(row['robots_over_hexagonal']) for row in group):.2f}",
            "duration [s]": f"{mean(float(row['duration_s']) for row in group):.0f}",
        }
        for (variant, kind, noise), group in sorted(groups.items())
    ]


def main() -> None:
    """Run every kind of building with every seed, and print a row each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variant", choices=VARIANTS, nargs="+", default=["central"])
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=list(KINDS))
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0], metavar="RAD", help="noise of bearings")
    add_campaign_options(parser, last_seed=2)
    asked = parser.parse_args()
    rows = carry_out(asked, cases(asked), lambda case: one_run(case, asked.set))
    write_csv(asked.csv, summary(rows))


if __name__ == "__main__":
    main()
