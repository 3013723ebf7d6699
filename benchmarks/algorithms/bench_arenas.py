"""Sensor coverage in given arenas: scenario files of buildings and maps that nobody drew for this algorithm.

A run is *right* if it is `completed` with a reachable coverage of at least 0.98, and *false* if it is `completed` with
less. Every other run ended as `failed`, with its reason, at the time limit, or in a traceback.

    python -m benchmarks.algorithms.bench_arenas --arenas folder --rows rows.csv --variant central decentralised
    python -m benchmarks.algorithms.bench_arenas --arenas folder --faults one-by-one at-once base restart --part 1 2

The files are named KIND-NUMBER.toml. Numbers are the slowest index and kinds the fastest, so that a part of a campaign is a
fair sample. The seed of a run is 100 and the number: it draws the place and the heading of the base, and all noise.
`--noise alternate` gives a half of the arenas bearings without noise, and the others a noise of pi/72.

With `--faults` a tenth of the robots that are out dies, one by one or at once, at times that the seed draws; or all robots
in sight of the base; or one robot crashes and returns after 10 s. `-and-loss` adds a loss of 0.3 of all messages.

With `--rows FILE` each run is stored when it ends, and runs that are stored are not repeated.
"""

import argparse
import math
import re
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import msgspec

from benchmarks.algorithms.bench_buildings import numbers_of
from benchmarks.common.campaign import add_campaign_options, carry_out, commit_of_copy, grouped
from benchmarks.common.csv_rows import write_csv
from benchmarks.common.verdicts import ENOUGH, VARIANTS, verdict
from zwerm import run
from zwerm.scenario.load import load

NOISES_RAD: Final = {"0": 0.0, "pi/72": math.pi / 72}
ALTERNATE: Final = "alternate"
FIRST_SEED: Final = 100
# Times of deaths [s] lie before this: small arenas are covered then.
LATEST_S: Final = 400.0
DEATH: Final = f'{{kind="crash", fraction=0.001, between_s=[10.0, {LATEST_S}]}}'
FAULTS: Final = {
    "none": "",
    "one-by-one": ",".join([DEATH] * 4),
    "at-once": f'{{kind="crash", fraction=0.1, between_s=[10.0, {LATEST_S}]}}',
    "base": '{kind="benchmarks.algorithms.bench_deaths:CrashBesideBase", at_s=AT}',
    "restart": f'{{kind="crash", fraction=0.001, between_s=[10.0, {LATEST_S}], for_s=10.0}}',
}
AND_LOSS: Final = "-and-loss"
LOSSY: Final = {"central": ("radio.loss=0.3", "uplink.loss=0.3"), "decentralised": ("radio.loss=0.3",)}


class Case(msgspec.Struct, frozen=True):
    """One run: its variant, the kind and number of its arena, its noise of bearings and its faults."""

    variant: str
    kind: str
    number: str
    noise: str
    faults: str


def cases(asked: argparse.Namespace) -> Iterator[Case]:
    """Yield the runs that are asked for, with the number of the arena as the slowest index."""
    found = sorted(
        (int(match[2]), match[1])
        for each in asked.arenas.glob("*.toml")
        if (match := re.fullmatch(r"(.+)-(\d+)", each.stem)) and (asked.kind is None or match[1] in asked.kind)
    )
    kinds = sorted({kind for _, kind in found})
    drawn = [
        Case(variant, kind, str(number), noise, faults)
        for number, kind in found
        if asked.seeds[0] <= number <= asked.seeds[1]
        for variant in asked.variant
        for noise in _noises(asked.noise, number + kinds.index(kind))
        for faults in _faults(asked.faults, number + kinds.index(kind), asked.each_fault)
    ]
    yield from drawn[asked.part[0] - 1 :: asked.part[1]]


def _noises(asked: Sequence[str], index: int) -> list[str]:
    """Return the noises of one arena."""
    return [list(NOISES_RAD)[index % 2]] if asked == [ALTERNATE] else list(asked)


def _faults(asked: Sequence[str], index: int, each: bool) -> list[str]:
    """Return the faults of one arena: all that are asked for, or one of them in turn."""
    return list(asked) if each else [asked[index % len(asked)]]


def one_run(case: Case, folder: Path, more: Sequence[str]) -> dict[str, str]:
    """Carry out one run, and return its row."""
    path = folder / f"{case.kind}-{case.number}.toml"
    seed = FIRST_SEED + int(case.number)
    loss = LOSSY[case.variant] if case.faults.endswith(AND_LOSS) else ()
    faults = FAULTS[case.faults.removesuffix(AND_LOSS)].replace("AT", str(drawn_time_s(seed)))
    settings = [
        *VARIANTS[case.variant],
        *loss,
        f"robots.sensors.0.sd_rad={NOISES_RAD[case.noise]}",
        f"faults=[{faults}]",
        *more,
    ]
    if case.variant == "central" and case.faults != "none":
        settings.append(f"coordinator.parameters.watch_until_s={LATEST_S + 20.0}")
    given = load(str(path), tuple(settings)).robots.count
    row = {**msgspec.structs.asdict(case), "seed": str(seed), "commit": commit_of_copy(), "robots_given": str(given)}
    began, cpu = time.perf_counter(), time.process_time()
    try:
        result = run(path, seed=seed, runner="inline", overrides=settings)
    except Exception as error:  # a traceback is a result of the campaign
        traceback.print_exc()
        found, outcome, reason, sim_s = dict[str, float](), "traceback", repr(error)[:200], math.nan
    else:
        found, outcome, reason, sim_s = result.metrics, result.outcome, result.reason, result.sim_s
    seen = found.get("reachable_coverage_fraction", math.nan)
    return row | {
        "verdict": verdict(outcome, seen),
        "reachable_coverage": f"{seen:.4f}",
        "robots": f"{found.get('robots_deployed', math.nan):g}",
        "robots_over_hexagonal": f"{found.get('robots_over_hexagonal', math.nan):.3f}",
        "duration_s": f"{sim_s:.1f}",
        "reason": reason,
        "wall_s": f"{time.perf_counter() - began:.1f}",
        "cpu_s": f"{time.process_time() - cpu:.1f}",
    }


def drawn_time_s(seed: int) -> float:
    """Return a time [s] that the seed draws, spread evenly over successive seeds."""
    return round(10.0 + (LATEST_S - 10.0) * (seed * (math.sqrt(5.0) - 1.0) / 2.0 % 1.0), 1)


def summary(rows: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """Return one row for each commit, variant, kind of arena and noise; with faults, for each commit, variant and faults."""
    with_faults = any(row["faults"] != "none" for row in rows)
    columns = ("variant", "commit", *(("faults",) if with_faults else ("kind", "noise")))
    return [
        {
            **dict(zip(columns, key, strict=True)),
            "commit": f"`{group[0]['commit']}`",  # some commits look like numbers
            **numbers_of(group),
            f"coverage of {ENOUGH:g} or more": str(sum(float(row["reachable_coverage"]) >= ENOUGH for row in group)),
            "ended with": _reasons(group),
        }
        for key, group in sorted(grouped(rows, *columns).items())
    ]


def _reasons(group: Sequence[dict[str, str]]) -> str:
    """Return the reasons of the runs that failed, with their numbers."""
    found = Counter(row["reason"].split(": ")[1] for row in group if row["verdict"] == "failed")
    return ", ".join(f"{count} {reason}" for reason, count in sorted(found.items()))


def main() -> None:
    """Run every arena, and print a row each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arenas", type=Path, required=True, metavar="FOLDER", help="of scenario files")
    parser.add_argument("--variant", choices=VARIANTS, nargs="+", default=["central"])
    parser.add_argument("--kind", nargs="+", help="kinds of arenas (default: all)")
    parser.add_argument("--noise", choices=[*NOISES_RAD, ALTERNATE], nargs="+", default=[ALTERNATE])
    faults = [*FAULTS, *(f"{each}{AND_LOSS}" for each in FAULTS)]
    parser.add_argument("--faults", choices=faults, nargs="+", default=["none"])
    parser.add_argument("--each-fault", action="store_true", help="every fault in every arena, not one in turn")
    parser.add_argument(
        "--part", type=int, nargs=2, default=[1, 1], metavar=("K", "N"), help="each N-th run, from the K-th"
    )
    add_campaign_options(parser, last_seed=34)
    asked = parser.parse_args()
    wanted = list(cases(asked))
    if not wanted:
        first, last = asked.seeds
        parser.error(f"{asked.arenas}: expected arenas of these kinds with numbers from {first} to {last}, found none")
    rows = carry_out(asked, wanted, lambda case: one_run(case, asked.arenas, asked.set))
    write_csv(asked.csv, summary(rows))


if __name__ == "__main__":
    main()
