"""Sensor coverage in small drawn buildings with openings as narrow as a body: whether `completed` is true.

The seed draws the building (`benchmarks/common/small_buildings.py`) and the pose of the base, the seed of the run draws the
noise of odometry and bearings. Each building is run with and without a coordinator, and with and without a robot that dies
in an opening. A run is *right* if it is `completed` with a reachable coverage of at least 0.98, and *false* if it is
`completed` with less. Every other run ended as `failed`, with its reason, or at the time limit.

    python -m benchmarks.algorithms.bench_openings --rows rows.csv --seeds 1 20
    python -m benchmarks.algorithms.bench_openings --rows rows.csv --variant decentralised --noise 0.0436332 --death yes
    python -m benchmarks.algorithms.bench_openings --rows rows.csv --seeds 694 694 --run-seeds 1 12 --until-in-sight

With `--until-in-sight` a run ends as `in sight` once 0.98 of its building has been in sight for half a minute. A false
`completed` comes before, so that false runs are found in less time.

With `--rows FILE` each run is stored when it ends, and runs that are stored are not repeated.
"""

import argparse
import itertools
import time
from collections.abc import Iterator, Sequence
from typing import Final

import msgspec

from benchmarks.common.campaign import add_campaign_options, carry_out, grouped
from benchmarks.common.csv_rows import write_csv
from benchmarks.common.small_buildings import small_building
from benchmarks.common.until_in_sight import UntilInSight
from benchmarks.common.verdicts import ENOUGH, VARIANTS, verdict
from zwerm import run

# 1.3 times the diameter of a body.
SURE_M: Final = 0.182
DURATION_S: Final = 3000.0


class Case(msgspec.Struct, frozen=True):
    """One run: the seeds of its building and of the run, the noise of bearings [rad], whether a robot dies, its variant."""

    seed: str
    run_seed: str
    noise_rad: str
    death: str
    variant: str


def cases(asked: argparse.Namespace) -> Iterator[Case]:
    """Yield the runs that are asked for, with the building as the slowest index. The seed of a run is that of its building
    unless others are asked for.
    """
    for seed in _between(asked.seeds):
        run_seeds = _between(asked.run_seeds or (seed, seed))
        for run_seed, noise, death, variant in itertools.product(run_seeds, asked.noise, asked.death, asked.variant):
            yield Case(str(seed), str(run_seed), f"{noise:g}", death, variant)


def _between(bounds: Sequence[int]) -> range:
    first, last = bounds
    return range(first, last + 1)


def one_run(case: Case, more: Sequence[str], until_in_sight: bool = False) -> dict[str, str]:
    """Carry out one run, to its end or until nearly all is in sight, and return its row."""
    building = small_building(int(case.seed))
    settings = [*building.settings(), "robots.count=30", f"time.duration_s={DURATION_S}"]
    settings += [f"robots.sensors.0.sd_rad={case.noise_rad}", *VARIANTS[case.variant], *more]
    if case.death == "yes":
        settings.append(building.death())
    began = time.process_time()
    watcher = UntilInSight() if until_in_sight else None
    result = run("sensor-coverage-narrow", int(case.run_seed), "inline", settings, watcher=watcher)
    seen = result.metrics["reachable_coverage_fraction"]
    return {
        **msgspec.structs.asdict(case),
        "joints": building.joints,
        "narrowest_m": f"{building.narrowest_m:.4f}",
        "verdict": "in sight" if watcher is not None and watcher.is_in_sight else verdict(result.outcome, seen),
        "died": f"{1 - result.metrics['faults_missed']:g}" if case.death == "yes" else "0",
        "reachable_coverage": f"{seen:.4f}",
        "robots": f"{result.metrics['robots_deployed']:g}",
        "duration_s": f"{result.sim_s:.1f}",
        "reason": result.reason,
        "cpu_s": f"{time.process_time() - began:.1f}",
    }


def summary(rows: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """Return one row for each variant, death, and class of openings."""
    classed = [
        {**row, "class": f"{SURE_M:g} m and wider" if float(row["narrowest_m"]) >= SURE_M else f"below {SURE_M:g} m"}
        for row in rows
    ]
    return [
        {"variant": variant, "a death": death, "openings": size, **numbers_of(group)}
        for (variant, death, size), group in sorted(grouped(classed, "variant", "death", "class").items())
    ]


def numbers_of(group: Sequence[dict[str, str]]) -> dict[str, str]:
    """Return what a table says about a group of runs."""
    right, false = (sum(row["verdict"] == each for row in group) for each in ("right", "false"))
    return {
        "runs": str(len(group)),
        "right": str(right),
        "completed falsely": str(false),
        "not completed": str(len(group) - right - false),
        "of these with 0.98 or more in sight": str(
            sum(
                row["verdict"] not in ("right", "false") and float(row["reachable_coverage"]) >= ENOUGH for row in group
            )
        ),
    }


def main() -> None:
    """Run every building with every variant, and print a row each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variant", choices=VARIANTS, nargs="+", default=list(VARIANTS))
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.0436332], metavar="RAD", help="of bearings")
    parser.add_argument("--death", choices=("no", "yes"), nargs="+", default=["no", "yes"])
    parser.add_argument("--run-seeds", type=int, nargs=2, metavar=("FIRST", "LAST"), help="of each building's runs")
    parser.add_argument("--until-in-sight", action="store_true", help="end a run once 0.98 of its building is in sight")
    add_campaign_options(parser, last_seed=2)
    asked = parser.parse_args()
    rows = carry_out(asked, cases(asked), lambda case: one_run(case, asked.set, asked.until_in_sight))
    write_csv(asked.csv, summary(rows))


if __name__ == "__main__":
    main()
