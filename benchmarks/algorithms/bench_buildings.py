"""Sensor coverage in drawn buildings: whether `completed` is true, how much is seen, and what it costs.

The seed draws the building (`tests/helpers/random_buildings.py`), the place and the heading of the base, and the noise of
odometry. A run is *right* if it is `completed` with a reachable coverage of at least 0.98, and *false* if it is
`completed` with less. Every other run ended as `failed`, with its reason, or at the time limit.

    python -m benchmarks.algorithms.bench_buildings --rows rows.csv --seeds 1 5
    python -m benchmarks.algorithms.bench_buildings --rows rows.csv --kind caves --variant decentralised --noise 0 0.0436332
    python -m benchmarks.algorithms.bench_buildings --rows rows.csv --faults one-by-one at-once restart

With `--faults` robots die at times that the seed draws: a tenth of those that are out, one by one or at once, or one that
restarts after 10 s. With a coordinator the run goes on until after the latest of these times.

With `--rows FILE` each run is stored when it ends, and runs that are stored are not repeated.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from statistics import mean
from typing import Final

import msgspec

from benchmarks.common.campaign import add_campaign_options, carry_out, grouped
from benchmarks.common.csv_rows import write_csv
from benchmarks.common.verdicts import VARIANTS, verdict
from tests.helpers.random_buildings import KINDS, random_building
from zwerm import run

WELL: Final = 0.99
BODY_M: Final = 0.14
# The latest death [s]. Buildings are covered after 400 to 2,500 s.
LATEST_S: Final = {"central": 1500, "decentralised": 1000}
ONE_BY_ONE: Final = ",".join(['{kind="crash", fraction=0.01, between_s=[10.0, LATEST]}'] * 10)
AT_ONCE: Final = '{kind="crash", fraction=0.1, between_s=[10.0, LATEST]}'
RESTART: Final = '{kind="crash", fraction=0.001, between_s=[10.0, LATEST], for_s=10.0}'
LOSSY: Final = "radio.loss=0.3"
FAULTS: Final = {
    "none": (),
    "one-by-one": (f"faults=[{ONE_BY_ONE}]",),
    "at-once": (f"faults=[{AT_ONCE}]",),
    "restart": (f"faults=[{RESTART}]",),
    "one-by-one-and-loss": (f"faults=[{ONE_BY_ONE}]", LOSSY),
    "at-once-and-loss": (f"faults=[{AT_ONCE}]", LOSSY),
}


class Case(msgspec.Struct, frozen=True):
    """One run: its variant, the kind of its building, the noise of bearings [rad], its seed and its faults."""

    variant: str
    kind: str
    noise_rad: str
    seed: str
    faults: str


def cases(asked: argparse.Namespace) -> Iterator[Case]:
    """Yield the runs that are asked for, with the seed as the slowest index."""
    for seed in range(asked.seeds[0], asked.seeds[1] + 1):
        for noise in asked.noise:
            for kind in asked.kind:
                for faults in asked.faults:
                    for variant in asked.variant:
                        yield Case(variant, kind, f"{noise:g}", str(seed), faults)


def one_run(case: Case, more: Sequence[str]) -> dict[str, str]:
    """Carry out one run, and return its row."""
    arena = f'{{wkt="{random_building(case.kind, int(case.seed))}", passage_m={BODY_M}}}'
    settings = [f"arena={arena}", f"robots.sensors.0.sd_rad={case.noise_rad}", *VARIANTS[case.variant], *more]
    latest_s = LATEST_S[case.variant]
    settings += [each.replace("LATEST", f"{latest_s}.0") for each in FAULTS[case.faults]]
    if case.variant == "central" and case.faults != "none":
        settings.append(f"coordinator.parameters.watch_until_s={latest_s + 20}.0")
    began = time.process_time()
    result = run("sensor-coverage-map", seed=int(case.seed), runner="inline", overrides=settings)
    found = result.metrics
    seen = found["reachable_coverage_fraction"]
    return {
        **msgspec.structs.asdict(case),
        "verdict": verdict(result.outcome, seen),
        "reachable_coverage": f"{seen:.4f}",
        "robots": f"{found['robots_deployed']:g}",
        "robots_over_hexagonal": f"{found['robots_over_hexagonal']:.3f}",
        "duration_s": f"{result.sim_s:.1f}",
        "reason": result.reason,
        "cpu_s": f"{time.process_time() - began:.1f}",
    }


def summary(rows: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """Return one row for each variant, kind of building and noise; with faults, for each variant and kind of faults."""
    if any(row["faults"] != "none" for row in rows):
        return [
            {"variant": variant, "faults": faults, **numbers_of(group)}
            for (variant, faults), group in sorted(grouped(rows, "variant", "faults").items())
        ]
    return [
        {"variant": variant, "building": kind, "noise of bearings [rad]": noise, **numbers_of(group)}
        for (variant, kind, noise), group in sorted(grouped(rows, "variant", "kind", "noise_rad").items())
    ]


def numbers_of(group: Sequence[dict[str, str]]) -> dict[str, str]:
    """Return what a table says about a group of runs."""
    return {
        "runs": str(len(group)),
        "completed": str(sum(row["verdict"] in ("right", "false") for row in group)),
        "completed falsely": str(sum(row["verdict"] == "false" for row in group)),
        f"coverage of {WELL:g} or more": str(sum(float(row["reachable_coverage"]) >= WELL for row in group)),
        "least coverage": min(row["reachable_coverage"] for row in group),
        "robots over packing": f"{mean(float(row['robots_over_hexagonal']) for row in group):.2f}",
        "duration [s]": f"{mean(float(row['duration_s']) for row in group):.0f}",
    }


def main() -> None:
    """Run every kind of building with every seed, and print a row each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variant", choices=VARIANTS, nargs="+", default=["central"])
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=list(KINDS))
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0], metavar="RAD", help="noise of bearings")
    parser.add_argument("--faults", choices=FAULTS, nargs="+", default=["none"])
    add_campaign_options(parser, last_seed=2)
    asked = parser.parse_args()
    rows = carry_out(asked, cases(asked), lambda case: one_run(case, asked.set))
    write_csv(asked.csv, summary(rows))


if __name__ == "__main__":
    main()
