"""Coverage by robot teams over drawn arenas, starts and faults: completeness, duration and repeated coverage.

Every run is drawn from its seed: the arena, or one of three halls, the places and headings at the start, and the fault.
The arena is the same for every number of robots. Runs are kept in a file and not made again, so that a long measurement
may be stopped and continued. A death in a division or a merge needs the undisturbed run of the same seed before it.

    python -m benchmarks.algorithms.bench_robot_teams --runs runs.csv --seeds 0-19 --robots 1 2 4
    python -m benchmarks.algorithms.bench_robot_teams --runs runs.csv --seeds 0-19 --robots 4 --setting loss death partition
    python -m benchmarks.algorithms.bench_robot_teams --runs runs.csv --summary --robots 1 2 4 --csv summary.csv
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import Polygon, box

from benchmarks.common.csv_rows import add_csv_option, append_row, read_rows, write_csv
from tests.helpers.random_arenas import ORIGIN_M, leaning_arena, random_arena, start_group
from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.scenario.load import tables_of, validate
from zwerm.scenario.tables import Scenario
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.metrics.robot_teams import coverage
from zwerm.world.tick.telemetry import TelemetryRecord
from zwerm.world.world import World

LIMIT_S: Final = 3000.0
# Faults begin at a random time of this span [s]; a partition, and the pause of a program, last so long.
FAULT_AT_S: Final = (2.0, 90.0)
FAULT_FOR_S: Final = 60.0
# A death in a division or a merge is at most this long after its first [s].
DURING_S: Final = 1.0

POLYGONS: Final = {
    "five": [[5.3, 6.1], [8.2, 4.2], [10.4, 7.3], [8.9, 10.6], [6.1, 10.1]],
    "low": [[13.1, 2.7], [16.9, 3.4], [17.6, 5.9], [14.2, 6.8]],
    "high": [[18.7, 9.3], [22.8, 8.1], [24.1, 11.7], [20.3, 13.2]],
}
# The halls by name: width, height, and obstacles.
HALLS: Final[dict[str, tuple[float, float, tuple[str, ...]]]] = {
    "empty": (20.0, 12.0, ()),
    "one obstacle": (20.0, 12.0, ("five",)),
    "three obstacles": (28.0, 16.0, ("five", "low", "high")),
}
# The arenas that are drawn from the seed: any polygons, and walls almost parallel to the slices.
DRAWN: Final = ("random", "leaning")
# Settings that differ from the scenario `robot-teams`.
SETTINGS: Final = (
    *("none", "loss", "bursts", "range", "death", "death of lead", "death in division", "death in merge"),
    *("partition", "pause", "coordinator", "coordinator loss"),
    *("virtual frontier", "never divides", "never merges", "one corridor"),
)
PARAMETERS: Final[dict[str, dict[str, bool]]] = {
    "virtual frontier": {"virtual_frontier": True},
    "never divides": {"divide": False},
    "never merges": {"merge": False},
    "one corridor": {"one_corridor": True},
}
COLUMNS: Final = (
    *("arena", "setting", "robots", "seed", "outcome", "coverage_fraction", "gap_m"),
    *("completion_time_s", "repeat_coverage_fraction", "area_m2", "messages", "bytes", "processor_s"),
    *("divisions", "merges", "division_s", "merge_s"),
)
# The column with the time of the event in which a robot dies.
EVENTS: Final = {"death in division": "division_s", "death in merge": "merge_s"}


def scenario(arena: str, setting: str, robots: int, seed: int, event_s: float | None = None) -> Scenario:
    """Return the scenario of one run; `event_s` is the time of the event in which a robot dies."""
    tables, _ = tables_of("robot-teams", ())
    tables["name"] = "drawn"
    origin_m = ORIGIN_M
    if arena in DRAWN:
        tables["arena"] = random_arena(seed, 1)[0] if arena == "random" else leaning_arena(seed)
        free = Polygon(tables["arena"]["polygon"], tables["arena"]["obstacles"])
    else:
        width, height, names = HALLS[arena]
        origin_m = 0.5
        tables["arena"] = {"size_m": [width, height], "obstacles": [POLYGONS[name] for name in names]}
        free = box(0.0, 0.0, width, height) - shapely.union_all([Polygon(POLYGONS[name]) for name in names])
    poses = start_group(np.random.default_rng([seed, robots]), free, robots, origin_m)
    tables["robots"]["count"] = robots
    tables["robots"]["placement"] = {"kind": "poses", "poses": poses}
    tables["robots"]["parameters"]["origin_m"] = origin_m
    tables["time"]["duration_s"] = LIMIT_S
    tables["robots"]["parameters"] |= PARAMETERS.get(setting, {})
    random = np.random.default_rng([77, seed, robots])
    return validate(tables | changed(setting, robots, random, event_s), "drawn", Path())


def changed(setting: str, robots: int, random: np.random.Generator, event_s: float | None) -> dict[str, Any]:
    """Return the tables that are different: the radio, faults, and services."""
    at_s = round(float(random.uniform(*FAULT_AT_S)), 2)
    if event_s is not None:
        at_s = round(event_s + float(random.uniform(0.0, DURING_S)), 2)
    order = [int(node) for node in random.permutation(robots)]
    cut = int(random.integers(1, robots)) if robots > 1 else 1
    bursts = {"kind": "gilbert_elliott", "loss_fraction": 0.2, "burst_packets": 8.0}
    parts = {"kind": "partition", "groups": [sorted(order[:cut]), sorted(order[cut:])], "at_s": at_s}
    tables: dict[str, dict[str, Any]] = {
        "loss": {"radio": {"loss": 0.3}},
        "bursts": {"radio": {"models": [bursts]}},
        "range": {"radio": {"range_m": 4.0}},
        "death": {"faults": [{"kind": "crash", "nodes": order[:1], "at_s": at_s}]},
        "death of lead": {"faults": [{"kind": "crash", "nodes": [0], "at_s": at_s}]},
        "death in division": {"faults": [{"kind": "crash", "nodes": order[:1], "at_s": at_s}]},
        "death in merge": {"faults": [{"kind": "crash", "nodes": order[:1], "at_s": at_s}]},
        "partition": {"faults": [{**parts, "for_s": FAULT_FOR_S}]},
        "pause": {"faults": [{"kind": "pause", "nodes": order[:1], "at_s": at_s, "for_s": FAULT_FOR_S}]},
        "coordinator": {"services": {"cells": "coordinator"}},
        "coordinator loss": {"services": {"cells": "coordinator"}, "uplink": {"loss": 0.3}},
    }
    return tables.get(setting, {})


class FirstEvents:
    """The time [s] of the first division and of the first merge, and the newest count of each by robot."""

    def __init__(self) -> None:
        self.counts: dict[str, dict[int, float]] = {"divisions": {}, "merges": {}}
        self.first_s: dict[str, float] = {}

    def report(self, record: TelemetryRecord) -> None:
        """Take in one record of telemetry."""
        for name, counts in self.counts.items():
            number = record.numbers.get(name, 0.0)
            if number > counts.get(record.node, 0.0):
                self.first_s.setdefault(name, record.time_s)
                counts[record.node] = number

    def first(self, name: str) -> str:
        """Return the time [s] of the first one, or nothing."""
        return f"{self.first_s[name]:.2f}" if name in self.first_s else ""

    def total(self, name: str) -> int:
        """Return the sum over all robots."""
        return int(sum(self.counts[name].values()))


def measure(arena: str, setting: str, robots: int, seed: int, event_s: float | None = None) -> dict[str, str]:
    """Run one trial; the coverage is measured on the true paths, and the smallest gap between bodies at every tick."""
    drawn = scenario(arena, setting, robots, seed, event_s)
    began = time.process_time()
    world = assemble(drawn, seed)
    events = FirstEvents()
    world.telemetry.listeners.append(events.report)
    nodes = {node: Node(*spec).answer for node, spec in node_specs(drawn, seed).items()}
    radius_m, footprint_m = drawn.robots.body.radius_m, float(drawn.robots.parameters["footprint_m"])
    paths = [world.scene.position.copy()]
    gaps = [np.inf]

    def note(world: World) -> None:
        places = world.scene.position
        paths.append(places.copy())
        between = [float(np.hypot(*(places[:robot] - places[robot]).T).min()) for robot in range(1, robots)]
        gaps[0] = min(gaps[0], min(between, default=np.inf) - 2.0 * radius_m)

    link = MemoryLink(nodes)
    outcome = LockStep(world, link, [note], link).run()
    processor_s = time.process_time() - began
    tracks = np.array(paths)
    found = coverage(world.scene.arena.free, [tracks[:, i] for i in range(robots)], radius_m, footprint_m)
    reports = [channel.ledger for channel in world.medium.channels.values()]
    values: dict[str, object] = {
        "arena": arena,
        "setting": setting,
        "robots": robots,
        "seed": seed,
        "outcome": outcome,
        "coverage_fraction": f"{found['coverage_fraction']:.6f}",
        "gap_m": f"{gaps[0]:.4f}" if robots > 1 else "",
        "completion_time_s": f"{world.scene.time_s:.2f}",
        "repeat_coverage_fraction": f"{found['repeat_coverage_fraction']:.4f}",
        "area_m2": f"{found['sweepable_area_m2']:.2f}",
        "messages": int(sum(int(np.sum(ledger.node_messages)) for ledger in reports)),
        "bytes": int(sum(int(np.sum(ledger.node_bytes)) for ledger in reports)),
        "processor_s": f"{processor_s:.1f}",
        "divisions": events.total("divisions"),
        "merges": events.total("merges"),
        "division_s": events.first("divisions"),
        "merge_s": events.first("merges"),
    }
    return {key: str(values[key]) for key in COLUMNS}


def summary(rows: Sequence[dict[str, str]], known: Sequence[dict[str, str]]) -> Iterator[dict[str, str]]:
    """Return one row for each arena, setting and number of robots: the worst coverage, and means over the runs.

    The time over one robot's, and over the undisturbed team's, are medians over pairs of runs of the same seed; the other
    run of a pair is among the `known` ones.
    """
    times = {key(row): float(row["completion_time_s"]) for row in known}

    def order(row: dict[str, str]) -> tuple[str, int, int]:
        return row["arena"], SETTINGS.index(row["setting"]), int(row["robots"])

    for (arena, setting, robots), group in groupby(sorted(rows, key=order), order):
        runs = list(group)
        name = SETTINGS[setting]
        alone = [times[key(r)] / times[arena, "none", "1", r["seed"]] for r in runs if one(r, times, "none", "1")]
        calm = [times[key(r)] / times[arena, "none", r["robots"], r["seed"]] for r in runs if one(r, times, "none", "")]
        gaps = [float(run["gap_m"]) for run in runs if run["gap_m"]]
        bound = [float(run["area_m2"]) / robots for run in runs]  # at 1 m/s and a footprint 1 m wide
        yield {
            "arena": arena,
            "setting": name,
            "robots": str(robots),
            "runs": str(len(runs)),
            "completed": str(sum(run["outcome"] == "completed" for run in runs)),
            "least coverage": f"{min(float(run['coverage_fraction']) for run in runs):.4f}",
            "least gap [m]": f"{min(gaps):z.3f}" if gaps else "",
            "time [s]": f"{np.mean([float(run['completion_time_s']) for run in runs]):.0f}",
            "time / one robot's": f"{np.median(alone):.2f}" if alone else "",
            "time / undisturbed": f"{np.median(calm):.2f}" if calm and setting else "",
            "time / undisturbed, most": f"{max(calm):.2f}" if calm and setting else "",
            "time / lower bound": f"{np.mean([times[key(r)] / b for r, b in zip(runs, bound, strict=True)]):.2f}",
            "repeat coverage": f"{np.mean([float(run['repeat_coverage_fraction']) for run in runs]):.2f}",
            "messages per robot": f"{np.mean([int(run['messages']) for run in runs]) / robots:.0f}",
            "times real time": f"{np.median([times[key(r)] / float(r['processor_s']) for r in runs]):.0f}",
        }


def key(row: dict[str, str]) -> tuple[str, str, str, str]:
    return row["arena"], row["setting"], row["robots"], row["seed"]


def one(row: dict[str, str], times: dict[tuple[str, str, str, str], float], setting: str, robots: str) -> bool:
    return (row["arena"], setting, robots or row["robots"], row["seed"]) in times


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Measure coverage by robot teams over drawn arenas, starts and faults."
    )
    parser.add_argument("--runs", type=Path, required=True, metavar="FILE", help="where the runs are kept")
    parser.add_argument("--seeds", default="0-1", metavar="FIRST-LAST")
    parser.add_argument("--robots", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--arenas", nargs="+", choices=[*DRAWN, *HALLS], default=["random"])
    parser.add_argument("--setting", nargs="+", choices=SETTINGS, default=["none"])
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no further run after so many minutes")
    parser.add_argument("--summary", action="store_true", help="make no run; summarise those that are kept")
    add_csv_option(parser)
    options = parser.parse_args()
    first, last = (int(each) for each in options.seeds.split("-"))
    rows = read_rows(options.runs)
    known = {key(row): row for row in rows}
    began = time.monotonic()
    wanted = [
        (arena, setting, robots, seed)
        for seed in range(first, last + 1)
        for arena in options.arenas
        for setting in options.setting
        for robots in options.robots
    ]
    for arena, setting, robots, seed in [] if options.summary else wanted:
        if (arena, setting, str(robots), str(seed)) in known or time.monotonic() - began > 60.0 * options.minutes:
            continue
        calm = known.get((arena, "none", str(robots), str(seed)), {})
        event_s = calm.get(EVENTS[setting]) if setting in EVENTS else None
        if setting in EVENTS and not event_s:
            continue  # no such event, or its time is not known
        row = measure(arena, setting, robots, seed, float(event_s) if event_s else None)
        known[key(row)] = row
        append_row(options.runs, row)
        print(" ".join(row.values()), flush=True)
    shown = [
        row
        for row in known.values()
        if row["arena"] in options.arenas and row["setting"] in options.setting and int(row["robots"]) in options.robots
    ]
    lines = list(summary(shown, list(known.values())))
    found = [{name: line[name] for name in line if any(each[name] for each in lines)} for line in lines]
    for line in found if options.summary else []:
        print(line)
    write_csv(options.csv, found)


if __name__ == "__main__":
    main()
