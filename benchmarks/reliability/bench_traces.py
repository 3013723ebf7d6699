"""True if runs in processes have the traces of runs inline: every scenario that ships, 20 seeds each.

Each scenario runs as it ships, and for fewer seeds with faults added: one robot killed and started again, one paused, one
slow. The virtual time is shortened. Trace, metrics and radio accounts of both runners must be equal. Two controls show that
the comparison can fail. Every seed must have another trace. So must seed 1 with more noise of drives and more loss.

A journal keeps each pair of runs, so that the campaign can be stopped at any time and continued by the same command.
"""

import argparse
import csv
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.run.result import RunResult
from zwerm.run.runner import Runner, run
from zwerm.scenario.load import built_in, load
from zwerm.scenario.tables import Scenario

DURATION_S: Final = 10.0

# Virtual seconds of scenarios in which little happens within DURATION_S, or whose ticks are short.
DURATIONS_S: Final = {
    "agreement-*": 15.0,
    "computation-free-maze": 31.0,
    "gossip-max": 5.0,
    "landmark-*": 15.0,
    "sensor-coverage-failures": 80.0,
    "sensor-coverage*": 40.0,
    "voronoi-coverage": 3.0,
    "voronoi-radio": 5.0,
}

SHIPPED: Final = "as it ships"
FAULTS: Final = "with faults"
COLUMNS: Final = ("scenario", "faults", "seed", "inline", "processes", "equal", "control", "ticks", "packets", "nodes")


@dataclass(frozen=True)
class Case:
    """A scenario as it is run, with its overrides."""

    name: str
    faults: str
    overrides: tuple[str, ...]

    def scenario(self, *more: str) -> Scenario:
        return load(self.name, (*self.overrides, *more))

    def control(self) -> tuple[str, ...]:
        """Return settings that change the trace: noisier drives, and a lossier radio where there is one."""
        scenario = self.scenario()
        noise = f"robots.body.drive_noise_fraction={scenario.robots.body.drive_noise_fraction + 0.001:g}"
        return (noise,) if scenario.radio is None else (noise, f"radio.loss={scenario.radio.loss + 0.01:g}")


def cases(patterns: Sequence[str]) -> list[Case]:
    """Return the scenarios whose names match, each as it ships and with faults."""
    found = []
    for name in built_in():
        if not any(fnmatchcase(name, each) for each in patterns):
            continue
        short_s = next((each for pattern, each in DURATIONS_S.items() if fnmatchcase(name, pattern)), DURATION_S)
        duration = f"time.duration_s={short_s}"
        plain = load(name)
        # Faults that the seed draws over the whole run are drawn over the shortened one.
        drawn = [index for index, fault in enumerate(plain.faults) if "between_s" in fault.parameters]
        earlier = [f"faults.{index}.between_s=[{0.1 * short_s}, {0.9 * short_s}]" for index in drawn]
        found.append(Case(name, SHIPPED, (duration, *earlier)))
        if not plain.faults:
            found.append(Case(name, FAULTS, (duration, f"faults=[{', '.join(fault_tables(plain, short_s))}]")))
    return found


def fault_tables(scenario: Scenario, duration_s: float) -> list[str]:
    """Return faults of up to three robots, within the run, as inline TOML tables."""
    kinds = ["crash", "pause", "slow"][: scenario.robots.count]
    more = {"slow": ", every_ticks = 3"}
    return [
        f'{{kind = "{kind}", nodes = [{node}], at_s = {duration_s * (0.2 + 0.1 * node):.1f}, '
        f"for_s = {duration_s * 0.2:.1f}{more.get(kind, '')}}}"
        for node, kind in enumerate(kinds)
    ]


def difference(inline: RunResult, processes: RunResult) -> str:
    """Return the first thing in which two runs differ, or nothing."""
    for name in ("trace", "outcome", "ticks", "robot_ticks", "metrics", "radio", "crashed", "restarted", "hindered"):
        # As text, since a metric that has no value is not equal to itself.
        if repr(getattr(inline, name)) != repr(getattr(processes, name)):
            return name
    return f"middleware lost {processes.middleware_lost}" if processes.middleware_lost else ""


def compare(case: Case, seed: int) -> dict[str, str]:
    """Run a case inline and in processes, and return the row of the journal."""

    def once(runner: Runner, *more: str) -> RunResult:
        return run(case.scenario(*more), seed, runner)

    inline, processes = once("inline"), once("processes")
    control = once("inline", *case.control()).trace if seed == 1 else ""
    touched = {*inline.crashed, *inline.restarted, *(node for each in inline.hindered.values() for node in each)}
    different = difference(inline, processes)
    return {
        "scenario": case.name,
        "faults": case.faults,
        "seed": str(seed),
        "inline": inline.trace,
        "processes": processes.trace,
        "equal": different or "yes",
        "control": control,
        "ticks": str(inline.ticks),
        "packets": str(inline.radio["delivered"]),
        "nodes": str(len(touched)),
    }


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of the journal, none where there is no journal."""
    with suppress(FileNotFoundError), path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
    return []


def missing(every: Sequence[Case], seeds: dict[str, int], rows: Sequence[dict[str, str]]) -> Iterator[tuple[Case, int]]:
    """Yield the pairs of runs that the journal lacks, seed by seed, so that a part of the campaign has all scenarios."""
    done = {(row["scenario"], row["faults"], row["seed"]) for row in rows}
    for seed in range(1, max(seeds.values()) + 1):
        for case in every:
            if seed <= seeds[case.faults] and (case.name, case.faults, str(seed)) not in done:
                yield case, seed


def summary(case: Case, rows: Sequence[dict[str, str]]) -> dict[str, str]:
    """Return the row of the table for one case."""
    own = [row for row in rows if (row["scenario"], row["faults"]) == (case.name, case.faults)]
    scenario = case.scenario()
    controls = [row["control"] != row["inline"] for row in own if row["control"]]
    return {
        "scenario": case.name,
        "run": case.faults,
        "robots": str(scenario.robots.count),
        "virtual time [s]": f"{scenario.time.duration_s:g}",
        "seeds": str(len(own)),
        "equal traces": str(sum(row["equal"] == "yes" for row in own)),
        "different traces of seeds": str(len({row["inline"] for row in own})),
        "control differs": "yes" if controls and all(controls) else "no",
        "packets delivered": f"{sum(int(row['packets']) for row in own)}",
        "nodes with faults": f"{sum(int(row['nodes']) for row in own)}",
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenarios", nargs="*", default=["*"], metavar="PATTERN", help="the scenarios; all by default")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--fault-seeds", type=int, default=5, help="seeds of the runs with faults")
    parser.add_argument("--journal", type=Path, default=Path("runs/traces.csv"), help="the file of all pairs of runs")
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after so long; the same command continues")
    add_csv_option(parser)
    options = parser.parse_args()
    every = cases(options.scenarios)
    options.journal.parent.mkdir(parents=True, exist_ok=True)
    todo = list(missing(every, {SHIPPED: options.seeds, FAULTS: options.fault_seeds}, rows_of(options.journal)))
    end_s = time.monotonic() + 60.0 * options.minutes
    with options.journal.open("a", encoding="utf-8", newline="") as file:
        journal = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if not file.tell():
            journal.writeheader()
        for number, (case, seed) in enumerate(todo, 1):
            if time.monotonic() > end_s:
                break
            row = compare(case, seed)
            journal.writerow(row)
            file.flush()
            print(f"{number}/{len(todo)} {case.name}, {case.faults}, seed {seed}: {row['equal']}", flush=True)
    rows = rows_of(options.journal)
    write_csv(options.csv, [summary(case, rows) for case in every])
    different = [row for row in rows if row["equal"] != "yes"]
    for row in different:
        print(f"DIFFERENT {row['equal']}: {row['scenario']}, {row['faults']}, seed {row['seed']}")
    print(f"{len(rows)} pairs of runs, {len(different)} different")
    sys.exit(bool(different))


if __name__ == "__main__":
    main()
