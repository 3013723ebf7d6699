"""Deaths and restarts in sensor coverage: whether every run ends by itself, and `completed` is true.

Each run has a schedule of faults that is drawn from its seed:

    at-once     a tenth of the robots that are out dies at one time
    one-by-one  as many robots die at times of their own
    base        all robots in sight of the base die at one time
    restart     one robot crashes, and returns without memory after up to 60 s
    silence     no radio message passes to or from the base for 240 s

The times are drawn over the whole deployment. A run is *right* if it is `completed` with a reachable coverage of at least
0.98, *honest* if it ends as `failed`, and *wrong* if it is `completed` with less or does not end by itself.

With `--rows FILE` each run is stored when it ends, and runs that are stored are not repeated. So a campaign can be
carried out in parts. Kinds of faults, halls and losses alternate, so each part is a fair sample.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from typing import Any, Final

import msgspec
import numpy as np

from benchmarks.common.campaign import add_campaign_options, carry_out, commit_of_copy, grouped
from benchmarks.common.chosen_crash import ChosenCrash
from benchmarks.common.csv_rows import write_csv
from benchmarks.common.verdicts import ENOUGH
from zwerm import RunResult, run
from zwerm.world.scene import Ints, Scene

VERDICTS: Final = ("right", "honest", "wrong")


class Hall(msgspec.Struct, frozen=True):
    """A hall: its settings, its robots as deployed without faults, and the time [s] after which it is covered then."""

    settings: tuple[str, ...]
    robots: int
    covered_s: float


HALLS: Final = {
    "small": Hall(("arena.size_m=[2.6,2.0]", "base.pose=[0.2,1.0,0.0]", "robots.count=30"), 10, 130.0),
    "medium": Hall(("arena.size_m=[4.4,3.6]", "base.pose=[0.2,1.8,0.0]", "robots.count=60"), 26, 350.0),
}
KINDS: Final = ("at-once", "one-by-one", "base", "restart", "silence")
# Settings of a variant, and the settings that state the fraction of messages that are lost.
VARIANTS: Final = {
    "decentralised": (("services.path=gradient",), ("radio.loss",)),
    "central": ((), ("radio.loss", "uplink.loss")),
}
SHARE: Final = 0.1
# Fewest robots that die one by one: in a small hall a tenth is one robot.
DEATHS_MIN: Final = 2
DOWN_S_MAX: Final = 60.0
SILENT_S: Final = 240.0
DURATION_S: Final = 8_000.0


class CrashBesideBase(ChosenCrash):
    """The robots in sight of the base crash for good."""

    def choose(self, scene: Scene, robots: Ints) -> list[int]:
        """Return the robots within the range of the base."""
        away_m = np.hypot(*(scene.position[robots] - scene.position[0]).T)
        return sorted(robots[away_m < 1.0].tolist())


def schedule(kind: str, hall: Hall, seed: int) -> list[dict[str, Any]]:
    """Return the faults of one run."""
    random = np.random.Generator(np.random.Philox(key=[seed, KINDS.index(kind)]))

    def at_s() -> float:
        return round(float(random.uniform(1.0, hall.covered_s)), 1)

    if kind == "at-once":
        return [{"kind": "crash", "fraction": SHARE, "at_s": at_s()}]
    if kind == "one-by-one":
        deaths = max(DEATHS_MIN, round(SHARE * hall.robots))
        return [{"kind": "crash", "fraction": 0.001, "at_s": at_s()} for _ in range(deaths)]
    if kind == "base":
        return [{"kind": "benchmarks.algorithms.bench_deaths:CrashBesideBase", "at_s": at_s()}]
    if kind == "silence":
        return [{"kind": "partition", "groups": [[0]], "at_s": at_s(), "for_s": SILENT_S}]
    down_s = round(float(random.uniform(0.1, DOWN_S_MAX)), 1)
    robot = int(random.integers(1, hall.robots))
    return [{"kind": "crash", "nodes": [robot], "at_s": at_s(), "for_s": down_s}]


def verdict(result: RunResult) -> str:
    """Return whether a run is `right`, `honest`, or `wrong`, by the module's rule."""
    if result.outcome == "completed":
        return "right" if result.metrics["reachable_coverage_fraction"] >= ENOUGH else "wrong"
    return "honest" if result.outcome == "failed" else "wrong"


class Case(msgspec.Struct, frozen=True):
    """One run: its variant, its hall, its kind of faults, the fraction of messages that are lost, and its seed."""

    variant: str
    hall: str
    faults: str
    loss: str
    seed: str


def cases(asked: argparse.Namespace) -> Iterator[Case]:
    """Yield the runs that are asked for, with the seed as the slowest index."""
    for seed in range(asked.seeds[0], asked.seeds[1] + 1):
        for loss in asked.loss:
            for hall in asked.hall:
                for variant in asked.variant:
                    for kind in asked.kind:
                        yield Case(variant, hall, kind, f"{loss:g}", str(seed))


def one_run(case: Case, more: Sequence[str]) -> dict[str, str]:
    """Carry out one run, and return its row."""
    hall, seed = HALLS[case.hall], int(case.seed)
    faults = schedule(case.faults, hall, seed)
    variant, losses = VARIANTS[case.variant]
    settings = [*hall.settings, *variant, f"time.duration_s={DURATION_S}", *(f"{each}={case.loss}" for each in losses)]
    tables = ", ".join("{" + ", ".join(f"{k} = {_toml(v)}" for k, v in each.items()) + "}" for each in faults)
    began = time.process_time()
    result = run("sensor-coverage", seed=seed, runner="inline", overrides=[*settings, *more, f"faults=[{tables}]"])
    found = result.metrics
    return {
        **msgspec.structs.asdict(case),
        "verdict": verdict(result),
        "outcome": result.outcome,
        "reachable_coverage": f"{found['reachable_coverage_fraction']:.4f}",
        "concluded_early": f"{found.get('concluded_early', 0.0):g}",
        "robots_released": f"{found.get('robots_released', 0.0):g}",
        "duration_s": f"{found.get('sim_s', result.sim_s):.1f}",
        "reason": result.reason,
        "faults_missed": f"{found['faults_missed']:g}",
        "schedule": tables,
        "commit": commit_of_copy(),
        "cpu_s": f"{time.process_time() - began:.1f}",
    }


def summary(rows: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """Return one row for each variant, hall, kind of schedule and loss: how many runs were right, honest or wrong."""
    return [
        {
            "variant": variant,
            "hall": hall,
            "faults": kind,
            "messages lost": loss,
            "runs": str(len(group)),
            **{each: str(sum(row["verdict"] == each for row in group)) for each in VERDICTS},
            "least reachable coverage": min(row["reachable_coverage"] for row in group),
            "mean duration [s]": f"{np.mean([float(row['duration_s']) for row in group]):.0f}",
            "faults too late": str(sum(row["faults_missed"] != "0" for row in group)),
        }
        for (variant, hall, kind, loss), group in sorted(grouped(rows, "variant", "hall", "faults", "loss").items())
    ]


def _toml(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def main() -> None:
    """Run every kind of schedule with every seed, print a row each, and how many runs were right."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variant", choices=VARIANTS, nargs="+", default=["decentralised"])
    parser.add_argument("--hall", choices=HALLS, nargs="+", default=["small"])
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=list(KINDS))
    parser.add_argument("--loss", type=float, nargs="+", default=[0.0])
    add_campaign_options(parser, last_seed=3)
    asked = parser.parse_args()
    rows = carry_out(asked, cases(asked), lambda case: one_run(case, asked.set))
    counts = {each: sum(row["verdict"] == each for row in rows) for each in VERDICTS}
    print(f"{len(rows)} runs: " + ", ".join(f"{count} {word}" for word, count in counts.items()))
    write_csv(asked.csv, summary(rows))


if __name__ == "__main__":
    main()
