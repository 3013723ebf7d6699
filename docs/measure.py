"""Measure a table of the documentation anew: `python docs/measure.py hall --seeds 20`; without a name, list them.

Runs the command that `measurements/plan.toml` has for it (`zwerm study`, `compare` or `twin`, or a benchmark), writes
`measurements/NAME.csv` and its provenance in `measurements/index.toml`, and fills in the pages (`docs/pages.py`).
"""

import argparse
import csv
import json
import math
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import tomli_w

sys.path.insert(0, str(Path(__file__).parent))

import _measured

ROOT: Final = Path(__file__).parents[1]
RUNS: Final = ROOT / "runs" / "measurements"
LIBRARIES: Final = ("eclipse-zenoh", "numpy", "pymunk", "scipy", "shapely")
CODE: Final = ("zwerm", "agents", "coordinator", "deploy", "world", "scenarios", "studies")
DIGITS: Final = 6
GIBIBYTE: Final = 2**30


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure tables of the documentation anew.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="what to measure; see the list that no name prints")
    parser.add_argument("--seeds", help="N or FIRST-LAST, instead of the plan's (studies and comparisons)")
    parser.add_argument("--jobs", type=int, help="trials at a time (studies and comparisons)")
    parser.add_argument("--benchmarks", action="store_true", help="measure every benchmark that is not slow")
    options = parser.parse_args()
    tables = _measured.plans()["tables"]
    names = list(options.names)
    if options.benchmarks:
        names += [name for name, plan in tables.items() if is_benchmark(plan) and not plan.get("slow")]
    for name in names:
        if "command" not in tables.get(name, {}):
            parser.error(f"{name}: expected one of {', '.join(each for each in tables if 'command' in tables[each])}")
    if not names:
        for name, plan in tables.items():
            print(f"{name:32} {shown(plan, plan.get('seeds')) if 'command' in plan else 'shows ' + plan['of']}")
    failed = [name for name in names if not measure(name, tables[name], options.seeds, options.jobs)]
    if names:
        subprocess.run([sys.executable, str(Path(__file__).with_name("pages.py"))], check=True)
    if failed:
        sys.exit(f"measure: not measured: {', '.join(failed)}")


def measure(name: str, plan: Mapping[str, Any], seeds: str | None, jobs: int | None) -> bool:
    """Run a plan's command and store its CSV file and provenance; return False where the command failed."""
    commit = commit_now(*(["benchmarks"] if is_benchmark(plan) else []))
    seeds = seeds or plan.get("seeds")
    print(f"{name}: {shown(plan, seeds)}", flush=True)
    if is_benchmark(plan):
        rows, trials = benchmark(plan), plan.get("trials", "")
    elif plan["command"][0] == "twin":
        rows, trials = twin(plan), plan.get("trials", "")
    else:
        rows = study(name, plan, seeds, jobs, commit)
        trials = trials_of(rows)
    if not rows:
        return False
    store(name, rows)
    note_origin(
        name,
        {
            "source": _measured.MEASURED,
            "command": shown(plan, seeds),
            "commit": commit,
            "date": datetime.now(UTC).date().isoformat(),
            "machine": machine(),
            "versions": versions(),
            "trials": trials,
        },
    )
    return True


def is_benchmark(plan: Mapping[str, Any]) -> bool:
    """True if a plan runs a module of benchmarks/."""
    return "command" in plan and plan["command"][0] == "-m"


def shown(plan: Mapping[str, Any], seeds: str | None) -> str:
    """Return a plan's command as a reader would type it."""
    if is_benchmark(plan):
        return shlex.join(["python", *plan["command"]])
    return shlex.join(["zwerm", *plan["command"], *(["--seeds", seeds] if seeds else [])])


# --- commit, machine and versions --------------------------------------------------------------------------------------------


def commit_now(*folders: str) -> str:
    """Return the last commit that changed the code or `folders`, marked where files differ from it.

    A commit of documentation or tests alone changes no result.
    """

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()

    changed = git("status", "--porcelain", "--", *CODE, *folders)
    return git("log", "-1", "--format=%h", "--abbrev=7", "--", *CODE, *folders) + ("+changes" if changed else "")


def machine() -> str:
    """Return the number of cores, the memory and the architecture of this machine."""
    memory_gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / GIBIBYTE
    return f"{os.cpu_count()} cores, {math.ceil(memory_gib)} GB, {platform.machine()}"


def versions() -> str:
    """Return the versions of Python and of the libraries that decide results."""
    return ", ".join([f"Python {platform.python_version()}", *(f"{each} {version(each)}" for each in LIBRARIES)])


# --- studies and comparisons ----------------------------------------------------------------------------------------


def study(name: str, plan: Mapping[str, Any], seeds: str | None, jobs: int | None, commit: str) -> list[dict[str, Any]]:
    """Run `zwerm study` or `zwerm compare`, and return one row for each point and metric; none where it failed."""
    # Rows are reused within a commit only, so that a table names the commit of all its rows.
    parquet = RUNS / f"{name}-{commit}.parquet"
    options = [*(["--seeds", seeds] if seeds else []), *(["--jobs", str(jobs)] if jobs else [])]
    command = [sys.executable, "-m", "zwerm", *plan["command"], *options, "--out", str(parquet), "--json"]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if not done.stdout:
        return []
    found = json.loads(done.stdout)
    trials = trials_in(parquet)
    rows = []
    for point in found["points"]:
        same = [trial for trial in trials if is_at(trial, point)]
        for metric, sample in point["metrics"].items():
            rows.append(
                row_of(point, metric, sample, [trial[metric] for trial in same if trial.get(metric) is not None])
            )
        completed = [float(trial["outcome"] == "completed") for trial in same]
        if completed:
            share = {"n": len(completed), "mean": sum(completed) / len(completed)}
            rows.append(row_of({**point, "differences": {}}, "completed", share, completed))
    return rows


def trials_in(parquet: Path) -> list[dict[str, Any]]:
    """Return the rows of a study's Parquet file."""
    import pyarrow.parquet as pq

    return list(pq.read_table(parquet).to_pylist())


def is_at(trial: Mapping[str, Any], point: Mapping[str, Any]) -> bool:
    """Return whether a trial is one of a point's."""
    settings = point["settings"].items()
    return (trial["variant"] or "") == (point["variant"] or "") and all(
        str(trial.get(axis)) == str(setting) for axis, setting in settings
    )


def row_of(point: Mapping[str, Any], metric: str, sample: Mapping[str, Any], values: Sequence[float]) -> dict[str, Any]:
    """Return a CSV row: variant, settings, metric and statistics of a metric at a point."""
    between = point.get("differences", {}).get(metric, {})
    kept = [value for value in values if not math.isnan(value)]
    return {"variant": point["variant"] or "", **point["settings"], "metric": metric} | {
        "n": sample["n"],
        **{key: sample.get(key) for key in ("mean", "sd", "half_width")},
        "least": min(kept, default=None),
        "most": max(kept, default=None),
        **{key: sample.get(key) for key in ("paper", "paper_is_bound", "agrees")},
        "pairs": between.get("n"),
        "difference": between.get("mean"),
        "difference_half_width": between.get("half_width"),
    }


def trials_of(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the number of trials at a point, or its range."""
    counts = sorted({int(row["n"]) for row in rows if row["metric"] == "completed"})
    return f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else str(counts[0]) if counts else ""


# --- benchmarks -----------------------------------------------------------------------------------------------------


def benchmark(plan: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Run a benchmark, and return the rows that it wrote; none where it failed."""
    RUNS.mkdir(parents=True, exist_ok=True)
    path = RUNS / "benchmark.csv"
    path.unlink(missing_ok=True)
    if subprocess.run([sys.executable, *plan["command"], "--csv", str(path)], cwd=ROOT, check=False).returncode:
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


# --- twins ----------------------------------------------------------------------------------------------------------


def twin(plan: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Run `zwerm twin` over both transports, and return one row for each quantity; none where it failed."""
    command = [sys.executable, "-m", "zwerm", *plan["command"], "--json"]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode or not done.stdout:
        return []
    udp, tcp = (json.loads(done.stdout)["transports"][name] for name in ("udp", "tcp"))

    def row(quantity: str, udp_value: Any, tcp_value: Any, modelled: Any = None) -> dict[str, Any]:
        return {"quantity": quantity, "modelled": modelled, "real, UDP": udp_value, "real, TCP": tcp_value}

    def real(quantity: str, *keys: str) -> dict[str, Any]:
        return row(quantity, *(each["real"][keys[0]][keys[1]] for each in (udp, tcp)))

    times = [each["real"]["heard_after_mean_s"] for each in (udp, tcp)]
    return [
        row("packets sent", udp["real"]["sent"], tcp["real"]["sent"], udp["modelled"]["sent"]),
        row(
            "fraction that got through",
            *(each["real"]["passed_fraction"] for each in (udp, tcp)),
            udp["modelled"]["passed_fraction"],
        ),
        row("difference to the model", udp["difference"], tcp["difference"]),
        row("half its 99 % interval", udp["half_width"], tcp["half_width"]),
        row(
            "links, and those that agree",
            *(f"{len(each['links']['sender'])}, {each['links_that_agree']}" for each in (udp, tcp)),
        ),
        row("from sending to receiving, mean [s]", *times, udp["modelled"]["heard_after_mean_s"]),
        real("delay of the network, median [s]", "delay_s", "median"),
        real("delay of the network, most [s]", "delay_s", "max"),
        row(
            "TCP segments, and those sent again",
            "",
            f"{tcp['real']['tcp_segments']}, {tcp['real']['tcp_segments_sent_again']}",
        ),
    ]


# --- the store ------------------------------------------------------------------------------------------------------


def store(name: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a measurement's CSV file."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with (_measured.STORE / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n", restval="")
        writer.writeheader()
        writer.writerows({key: as_text(value) for key, value in row.items()} for row in rows)


def as_text(value: Any) -> Any:
    """Return a value as it is stored: floats with DIGITS significant digits, and nothing for what is not known."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else value


def note_origin(name: str, origin: Mapping[str, str]) -> None:
    """Write a measurement's provenance into index.toml."""
    every = _measured.origins() | {name: dict(origin)}
    text = tomli_w.dumps(dict(sorted(every.items())))
    head = "# Where each CSV file comes from; written by docs/measure.py.\n\n"
    (_measured.STORE / "index.toml").write_text(head + text, encoding="utf-8")


if __name__ == "__main__":
    main()
