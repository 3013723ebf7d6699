"""The numbers that landmark-based exploration is asked for, in runs that can be interrupted: each trial is kept in a file.

`--only GROUP ...` carries out some groups of trials, and `--show` none. A trial is one run, inline on one core. All trials are
kept as lines of JSON in `runs/landmark-numbers.jsonl`, with the commit of the code. Trials of other commits are left out,
unless `--commit` names them: those whose runs are the same, trace by trace. `--runs FILE` writes all as CSV, and
`--load FILE` reads such a file.
The halls of the group `halls` are drawn: their size, obstacles, landmarks, robots and trouble.
"""

import argparse
import csv
import json
import math
import subprocess
import time
from collections.abc import Collection, Iterator, Sequence
from itertools import combinations
from pathlib import Path
from statistics import mean
from typing import Any, Final

import gudhi

from benchmarks.common.csv_rows import add_csv_option, write_csv
from benchmarks.common.landmark_groups import GROUPS
from benchmarks.common.landmark_halls import hall
from zwerm import RunResult, run
from zwerm.agents.landmark_exploration.mapping.landmark_map import LandmarkMap
from zwerm.agents.landmark_exploration.mapping.map_reports import MapReport, read_report
from zwerm.agents.landmark_exploration.sharing.log_entries import snapshot_of
from zwerm.maths.statistics import condense
from zwerm.world.metrics.landmark_exploration import maximal

ROOT: Final = Path(__file__).parents[2]
TRIALS: Final = ROOT / "runs" / "landmark-numbers.jsonl"
CODE: Final = ("zwerm", "agents", "coordinator", "world", "scenarios")

KEPT: Final = (
    "completion_fraction",
    "iterations",
    "iterations_to_90_percent_completion",
    "iterations_to_91_5_percent_completion",
    "iterations_to_95_percent_completion",
    "landmarks",
    "landmark_complex_holes",
    "obstacles",
    "open_frontiers",
    "concluded_early",
    "navigation_goals",
    "navigation_success_fraction",
    "navigation_iterations_mean",
    "messages_per_robot_mean",
    "bytes_per_robot_mean",
)
EXTRA: Final = ("gudhi_agrees", "processes_agree", "update_mean_ms", "update_most_ms")
COLUMNS: Final = ("group", "seed", "commit", "outcome", "problems", "processor_s", *KEPT, *EXTRA)


def commit_now() -> str:
    """Return the last commit that changed the code."""
    command = ["git", "log", "-1", "--format=%h", "--abbrev=7", "--", *CODE]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def trials(commits: Collection[str]) -> Iterator[dict[str, Any]]:
    """Yield the trials that are kept of some commits."""
    lines = TRIALS.read_text(encoding="utf-8").splitlines() if TRIALS.exists() else []
    yield from (trial for trial in map(json.loads, lines) if trial["commit"] in commits)


def keep(trial: dict[str, Any]) -> None:
    """Add a trial to those that are kept."""
    TRIALS.parent.mkdir(parents=True, exist_ok=True)
    with TRIALS.open("a", encoding="utf-8") as file:
        file.write(json.dumps(trial) + "\n")


def load_runs(path: Path) -> None:
    """Keep the trials of a CSV file that `--runs` wrote."""
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            kept = {name: value for name, value in row.items() if value != ""}
            text = ("group", "commit", "outcome")
            numbers = {name: float(value) for name, value in kept.items() if name not in text}
            keep({name: int(numbers[name]) if name == "seed" else numbers.get(name, kept[name]) for name in kept})


def reports_of(result: RunResult) -> list[MapReport]:
    """Return what the nodes of a run reported about their maps."""
    found = [read_report(each.snapshot) for each in result.snapshots if each.snapshot]
    return [each for each in found if isinstance(each, MapReport)]


def gudhi_agrees(result: RunResult) -> dict[str, float]:
    """Return 1 if gudhi finds the same Betti numbers of the final complex, else 0; nothing without a complex."""
    metrics = result.metrics
    if "landmark_complex_holes" not in metrics:
        return {}
    tree = gudhi.SimplexTree()
    for simplex in maximal(each for report in reports_of(result) for each in report.simplices):
        for face in combinations(simplex, min(len(simplex), 3)):
            tree.insert(list(face))
    tree.compute_persistence(homology_coeff_field=2, min_persistence=-1, persistence_dim_max=True)
    found = [*tree.betti_numbers(), 0, 0][:2]
    return {"gudhi_agrees": float(found == [metrics["landmark_complex_pieces"], metrics["landmark_complex_holes"]])}


def update_times(result: RunResult) -> dict[str, float]:
    """Return the processor time [ms] that a map takes for one observation of a run, on average and at most."""
    map_, times = LandmarkMap(), []
    for report in reports_of(result):
        for landmarks, bearings in zip(report.simplices, report.bearings, strict=True):
            snapshot = snapshot_of(zip(landmarks, bearings, strict=True))
            began = time.process_time()
            map_.observe(snapshot)
            times.append(1e3 * (time.process_time() - began))
    return {"update_mean_ms": round(mean(times), 4), "update_most_ms": round(max(times), 3)}


def carry_out(group: str, commit: str, commits: Collection[str]) -> None:
    """Run the trials of a group that are not kept yet, and keep each."""
    scenario, settings, seeds = GROUPS[group]
    done = {trial["seed"] for trial in trials(commits) if trial["group"] == group}
    for seed in range(1, seeds + 1):
        if seed in done:
            continue
        began = time.process_time()
        result = run(scenario, seed, "inline", [*settings, *(hall(seed) if group == "halls" else ())])
        ended = time.process_time()
        trial = {
            "group": group,
            "seed": seed,
            "commit": commit,
            "outcome": result.outcome,
            "problems": len(result.problems),
            "processor_s": round(ended - began, 1),
            **{name: result.metrics[name] for name in KEPT if name in result.metrics},
            **gudhi_agrees(result),
        }
        if group == "complex-processes":
            trial["processes_agree"] = float(run(scenario, seed, "processes", list(settings)).trace == result.trace)
        if group == "complex-updates":
            trial |= update_times(result)
        keep(trial)
        print(group, seed, trial["outcome"], int(result.ticks), trial["processor_s"], flush=True)


class Group:
    """The trials of one group."""

    def __init__(self, name: str, some: Sequence[dict[str, Any]], above: int = 0) -> None:
        self.trials = [trial for trial in some if trial["group"] == name and trial["seed"] > above]

    def __len__(self) -> int:
        return len(self.trials)

    def values(self, metric: str) -> list[float]:
        """Return the values of a metric in the trials that have it."""
        return [trial[metric] for trial in self.trials if metric in trial]

    def by_seed(self, metric: str) -> dict[int, float]:
        """Return the value of a metric by the seed of its trial."""
        return {trial["seed"]: trial[metric] for trial in self.trials if metric in trial}

    def mean(self, metric: str) -> float:
        """Return the mean of a metric."""
        return mean(self.values(metric))


def summary(some: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each number that is asked for and of which there are trials."""
    groups = {name: Group(name, some) for name in GROUPS}
    for name in ("free-gossip", "free-gossip-range"):
        groups[f"{name}, fresh seeds"] = Group(name, some, above=10)
    rows: list[dict[str, Any]] = []

    def row(what: str, asked: str, measured: str, *names: str, paper: str = "") -> None:
        counts = sorted({len(groups[name]) for name in names})
        overall(what, asked, measured, " and ".join(map(str, counts)), paper)

    def overall(what: str, asked: str, measured: str, n: int | str, paper: str = "") -> None:
        rows.append({"what": what, "asked": asked, "the paper": paper, "measured": measured, "n": str(n)})

    def compared(of: str, over: str) -> None:
        if not groups[of] or not groups[over]:
            return
        completed = sum(each["outcome"] == "completed" for each in groups[of].trials)
        row(f"runs completed, {of}", "", f"{completed} of {len(groups[of])}", of)
        row(f"completion, {of}", "", spread(groups[of], "completion_fraction", 3), of)
        ratio = groups[of].mean("iterations") / groups[over].mean("iterations")
        row(f"iterations, {of} over {over}", "", f"{ratio:.2f}", of, over)
        sent = groups[of].mean("bytes_per_robot_mean") / groups[over].mean("bytes_per_robot_mean")
        row(f"bytes of a robot, {of} over {over}", "", f"{sent:.2f}", of, over)

    def spread(group: Group, metric: str, digits: int) -> str:
        """Return the mean, half its 95 % interval, the least and the most."""
        values = group.values(metric)
        half = condense(values).half_width
        interval = "" if math.isnan(half) else f" ± {half:.{digits}f}"
        return f"{mean(values):.{digits}f}{interval} ({min(values):.{digits}f} to {max(values):.{digits}f})"

    def ratio_of(group: Group, other: Group, metric: str) -> str:
        return f"{group.mean(metric) / other.mean(metric):.2f}"

    def less(group: Group, other: Group) -> str:
        """Return the mean difference of completions of the seeds that both groups have, and its 95 % interval."""
        found, others = group.by_seed("completion_fraction"), other.by_seed("completion_fraction")
        apart = condense([found[seed] - others[seed] for seed in sorted(found.keys() & others.keys())])
        if math.isnan(apart.half_width):
            return f"{apart.mean:+.3f}"
        return f"{apart.mean:+.3f} ({apart.mean - apart.half_width:+.3f} to {apart.mean + apart.half_width:+.3f})"

    for name, asked, paper in (
        ("free", ".96", ("0.98", "1864")),
        ("simple", ".95", ("0.95", "1266")),
        ("complex", ".915", ("0.915", "2373")),
    ):
        group = groups[name]
        if not group:
            continue
        row(f"completion, {name}", f"at least 0{asked}", spread(group, "completion_fraction", 3), name, paper=paper[0])
        completed = sum(each["outcome"] == "completed" for each in group.trials)
        row(f"runs completed, {name}", "", f"{completed} of {len(group)}", name)
        row(f"iterations to the end, {name}", "", spread(group, "iterations", 0), name, paper=paper[1])
    whole = [each for name in ("free", "simple", "complex") for each in groups[name].trials]
    if whole:
        equal = sum(each["landmark_complex_holes"] == each["obstacles"] for each in whole)
        overall("holes equal obstacles", "in at least 95 %", f"{equal} of {len(whole)}", len(whole))
    name = "iterations_to_91_5_percent_completion"
    if groups["complex"]:
        row(
            "iterations to 91.5 %, complex", "at most 2373", spread(groups["complex"], name, 0), "complex", paper="2373"
        )
    for few, count in (("complex-10", 10), ("complex-20", 20)):
        if groups[few] and groups["complex"]:
            ratio = groups[few].mean(name) / groups["complex"].mean(name)
            least = 0.85 * 30 / count
            row(f"speed of 30 robots over {count}, to 91.5 %", f"at least {least:.2f}", f"{ratio:.2f}", few, "complex")
            to_end = ratio_of(groups[few], groups["complex"], "iterations")
            row(f"speed of 30 robots over {count}, to the end", "", to_end, few, "complex")
    if groups["complex-gossip"] and groups["complex"]:
        what = "iterations to 91.5 %, complex-gossip over complex"
        row(
            what,
            "at most 1.3",
            ratio_of(groups["complex-gossip"], groups["complex"], name),
            "complex-gossip",
            "complex",
        )
    for of, over, asked in (
        ("complex-gossip", "complex", 1.3),
        ("free-gossip", "free", 1.3),
        ("free-gossip-loss", "free-gossip", 2),
        ("free-gossip-bursts", "free-gossip", 2),
        ("free-gossip-range", "free-gossip", 2),
        ("free-gossip-range, fresh seeds", "free-gossip, fresh seeds", 2),
    ):
        if groups[of] and groups[over]:
            ratio = ratio_of(groups[of], groups[over], "iterations")
            row(f"iterations, {of} over {over}", f"at most {asked}", ratio, of, over)
            row(f"completion, {of} less {over}", "at least -0.010", less(groups[of], groups[over]), of, over)
    for of, over in (("free-64-bytes", "free"), ("free-gossip-64-bytes", "free-gossip"), ("presence", "free-gossip")):
        compared(of, over)
    for name in ("free-nearest-frontier", "free-min-pos"):
        compared(name, "free")
    if groups["free"]:
        to_95 = "iterations_to_95_percent_completion"
        row("iterations to 95 %, free", "", spread(groups["free"], to_95, 0), "free")
        for name, paper in (("random-walk", "about 3"), ("random-walk-best", "")):
            reached = len(groups[name].values(to_95))
            if not reached:
                continue
            row(f"runs that reach 95 %, {name}", "", f"{reached} of {len(groups[name])}", name)
            row(f"iterations to 95 %, {name}", "", spread(groups[name], to_95, 0), name)
            ratio = ratio_of(groups[name], groups["free"], to_95)
            row(f"iterations to 95 %, {name} over free", "", ratio, name, "free", paper=paper)
    name, to_91_5 = "complex-random-walk", "iterations_to_91_5_percent_completion"
    if groups[name].values(to_91_5) and groups["complex"]:
        row(f"iterations to 91.5 %, {name}", "", spread(groups[name], to_91_5, 0), name)
        row(
            f"iterations to 91.5 %, {name} over complex",
            "",
            ratio_of(groups[name], groups["complex"], to_91_5),
            name,
            "complex",
        )
    for name in ("navigate", "navigate-presence"):
        if groups[name]:
            goals = sum(groups[name].values("navigation_goals"))
            reached = round(goals * groups[name].mean("navigation_success_fraction"))
            row(f"goals reached, {name}", "100 of 100", f"{reached} of {goals:.0f}", name)
            row(f"iterations to a goal, {name}", "", f"{groups[name].mean('navigation_iterations_mean'):.0f}", name)
    judged = [each for each in some if "gudhi_agrees" in each]
    if judged:
        agree = sum(each["gudhi_agrees"] for each in judged)
        overall("gudhi agrees on the final complex", "all", f"{agree:.0f} of {len(judged)}", len(judged))
    if groups["complex-updates"]:
        group = groups["complex-updates"]
        times = f"{group.mean('update_mean_ms'):.3f}; at most {group.mean('update_most_ms'):.1f}"
        row(f"update of a map of {group.mean('landmarks'):.0f} landmarks [ms]", "at most 5", times, "complex-updates")
    if groups["complex-processes"]:
        equal = sum(groups["complex-processes"].values("processes_agree"))
        row("traces of 30 processes equal inline", "all", f"{equal:.0f}", "complex-processes")
    if groups["complex"]:
        pace = mean(0.1 * each["iterations"] / each["processor_s"] for each in groups["complex"].trials)
        row("inline faster than real time, complex", "at least 10", f"{pace:.0f}", "complex")
    ended = [each for each in some if "concluded_early" in each and "random-walk" not in each["group"]]
    if ended:
        early = sum(each["concluded_early"] for each in ended)
        completed = sum(each["outcome"] == "completed" for each in ended)
        overall("runs that concluded early", "0 in 100", f"{early:.0f}; {completed} completed", len(ended))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--only", nargs="+", choices=GROUPS, default=list(GROUPS), metavar="GROUP", help=", ".join(GROUPS)
    )
    parser.add_argument("--show", action="store_true", help="run nothing: show what is kept")
    parser.add_argument(
        "--commit", nargs="+", default=[], help="count trials of these commits, too: their runs have the same traces"
    )
    parser.add_argument(
        "--load", type=Path, metavar="FILE", help="keep the trials of this CSV file, too, and run nothing"
    )
    parser.add_argument("--runs", type=Path, metavar="FILE", help="write all trials to this CSV file, too")
    add_csv_option(parser)
    options = parser.parse_args()
    if options.load is not None:
        load_runs(options.load)
        return
    commit = commit_now()
    commits = {commit, *options.commit}
    for group in () if options.show else options.only:
        carry_out(group, commit, commits)
    some = sorted(trials(commits), key=lambda trial: (list(GROUPS).index(trial["group"]), trial["seed"]))
    if options.runs is not None:
        write_csv(options.runs, [{name: trial.get(name, "") for name in COLUMNS} for trial in some])
    rows = summary(some)
    for row in rows:
        print(f"{row['what']:48} {row['asked']:18} {row['measured']:28} n {row['n']}")
    write_csv(options.csv, rows)


if __name__ == "__main__":
    main()
