"""Speed of this source tree beside an earlier commit's: paired runs that alternate, in one go, on one core.

    python -m benchmarks.speed.regressions                  # the commit before this one
    python -m benchmarks.speed.regressions --base v0.1.0 --case e-pucks-25 --rounds 15

Two processes stay alive, one for each tree. In each round both run the same scenario and seed, in an order that alternates,
and the times of the two runs give one ratio. Inline this is processor time, with robots in processes the time that passes. A
case `start` measures the processor time of a program. The result is the median ratio, with its 95 % interval by ranks. A
regression of over 10 % whose interval excludes 1 is named, and the exit status is 1. Results are appended to a file with
commits, machine and versions. Both trees run interpreted, without the C extension that `make setup` makes. `--case all` adds
the cases that are long or run in processes; a case that the other tree cannot run is named and left out.
"""

import argparse
import csv
import json
import os
import platform
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Final

ROOT = Path(__file__).parents[2]
STORE = ROOT / "runs" / "regressions.csv"
REGRESSION = 0.9
LIBRARIES = ("eclipse-zenoh", "numpy", "pymunk", "scipy", "shapely")


@dataclass(frozen=True)
class Case:
    """A scenario with overrides and the runner, or, without a scenario, the arguments of a program that starts and ends."""

    scenario: str
    overrides: tuple[str, ...]
    runner: str = "inline"


RADIO: Final = ("arena.size_m=[12, 12]", "radio.range_m=1.5")
SMALL_HALL: Final = ("arena.size_m=[2.0, 1.5]", "robots.count=30", "base.pose=[0.2, 0.5, 0.0]")
LOSSY_HALL: Final = ("arena.size_m=[4.0, 3.0]", "robots.count=40", "base.pose=[0.2, 1.5, 0.0]")
FIVE_MODELS: Final = (
    'radio.models=[{kind="range", range_m=9}, {kind="line_of_sight"}, {kind="loss", fraction=0.1}, '
    '{kind="gilbert_elliott", loss_fraction=0.1, burst_packets=4}, {kind="delay", jitter_s=0.1, distribution="exponential"}]'
)

# One scenario of each kind of cost: sensing and physics, the radio, few awake robots, geometry.
CASES: Final = {
    "e-pucks-25": Case("computation-free", ("time.duration_s=40",)),
    "e-pucks-100": Case("computation-free-scaling", ("robots.count=100", "time.duration_s=12")),
    "radio-100": Case("beacon", ("robots.count=100", "time.duration_s=6", *RADIO)),
    "sensor-coverage": Case("sensor-coverage", SMALL_HALL),
    "voronoi": Case("voronoi-coverage-table1", ("time.duration_s=2.0",)),
}
MORE: Final = {
    "e-pucks-1000": Case(
        "computation-free-scaling",
        ("robots.count=1000", "time.duration_s=2", "arena.size_m=[9.5, 9.5]", "robots.placement.radius_m=2.2"),
    ),
    "radio-1000": Case(
        "beacon", ("robots.count=1000", "time.duration_s=1", "arena.size_m=[38, 38]", "radio.range_m=1.5")
    ),
    "radio-five-models": Case(
        "beacon", ("robots.count=100", "time.duration_s=4", "arena.size_m=[12, 12]", FIVE_MODELS)
    ),
    "sensor-coverage-decentralised": Case("sensor-coverage", (*SMALL_HALL, "services.path=gradient")),
    "sensor-coverage-lossy": Case("sensor-coverage", (*LOSSY_HALL, "services.path=gradient", "radio.loss=0.3")),
    "robot-teams": Case("robot-teams", ("time.duration_s=60",)),
    "landmark-free": Case("landmark-free", ("time.duration_s=60",)),
    "lock-step-25": Case("computation-free", ("time.duration_s=30",), "processes"),
    "start-100": Case("computation-free-scaling", ("robots.count=100", "time.duration_s=0.1"), "processes"),
    "start-help": Case("", ("-m", "zwerm", "--help")),
    "start-list": Case("", ("-m", "zwerm", "list")),
}

WORKER = """
import json, os, resource, subprocess, sys, time
from importlib.machinery import SOURCE_SUFFIXES, FileFinder, SourceFileLoader

def interpreted(folder):
    if not folder.startswith(os.path.join(os.getcwd(), "zwerm", "")):
        raise ImportError
    return FileFinder(folder, (SourceFileLoader, SOURCE_SUFFIXES))

sys.path_hooks.insert(0, interpreted)

def of_programs():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime

for line in sys.stdin:
    scenario, arguments, runner, seed = json.loads(line)
    import zwerm
    ticks = 1
    if not scenario:
        began = of_programs()
        subprocess.run([sys.executable, *arguments], capture_output=True, check=True)
        spent = of_programs() - began
    else:
        clock = time.process_time if runner == "inline" else time.perf_counter
        began = clock()
        ticks = zwerm.run(scenario, seed=seed, runner=runner, overrides=arguments).robot_ticks
        spent = clock() - began
    print(json.dumps([spent, ticks, zwerm.__file__]), flush=True)
"""


class Tree:
    """A source tree and the process that runs its code."""

    def __init__(self, folder: Path) -> None:
        environment = os.environ | {"PYTHONPATH": str(folder)}  # both keep bytecode, or a start would compile it
        self._folder = folder
        self._said = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115 (closed in `close`)
        self._process = subprocess.Popen(
            [sys.executable, "-c", WORKER],
            cwd=folder,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            text=True,
        )

    def cost_s(self, case: str, seed: int) -> float:
        """Return the time of a robot-tick or of a program [s]. Raises RuntimeError where the tree cannot run the case."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        given = (CASES | MORE)[case]
        self._process.stdin.write(json.dumps([given.scenario, given.overrides, given.runner, seed]) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            self._said.seek(0)
            *_, reason = self._said.read().splitlines() or [""]
            raise RuntimeError(f"{self._folder} cannot run it: {textwrap.shorten(reason, 200)}")
        spent_s, robot_ticks, file = json.loads(line)
        if not Path(file).is_relative_to(self._folder):
            raise RuntimeError(f"{file}: expected the code of {self._folder}")
        return float(spent_s) / int(robot_ticks)

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()
        self._said.close()


@contextmanager
def checkout(revision: str) -> Iterator[Path]:
    """Yield a temporary folder with the tree of a commit."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        subprocess.run(["git", "worktree", "add", "--quiet", "--detach", str(tree), revision], cwd=ROOT, check=True)
        try:
            yield tree
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", str(tree)], cwd=ROOT, check=True)


def commit_of(revision: str) -> str:
    """Return the short name of a commit."""
    words = ["git", "rev-parse", "--short=7", revision]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def interval(ratios: list[float]) -> tuple[float, float]:
    """Return the 95 % interval of the median of ratios, from their ranks; all of them where there are fewer than six."""
    from scipy.stats import binom

    ordered, n = sorted(ratios), len(ratios)
    rank = max(int(binom.ppf(0.025, n, 0.5)), 1)
    return ordered[rank - 1], ordered[n - rank]


def paired(base_folder: Path, case: str, rounds: int) -> list[float]:
    """Return the speed of this tree over that of the other, once for each round. Raises RuntimeError where one cannot run."""
    base, here = Tree(base_folder), Tree(ROOT)
    try:
        ratios = []
        for index in range(-1, rounds):  # the round -1 imports and warms up
            order = (base, here) if index % 2 else (here, base)
            costs = {tree: tree.cost_s(case, max(index, 0) + 1) for tree in order}
            if index >= 0:
                ratios.append(costs[base] / costs[here])
        return ratios
    finally:
        base.close()
        here.close()


def main() -> None:
    """Measure the chosen cases, print and store the ratios, and exit with 1 where one is a regression."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", default="HEAD~1", help="the commit to compare with (HEAD~1)")
    parser.add_argument(
        "--case",
        action="append",
        choices=[*CASES, *MORE, "all"],
        help="a case, instead of the first five; may be repeated",
    )
    parser.add_argument("--rounds", type=int, default=9, help="pairs of runs of each case, 6 or more for an interval")
    parser.add_argument("--store", type=Path, default=STORE, help=f"the file that receives the result ({STORE.name})")
    options = parser.parse_args()
    commits = commit_of(options.base), commit_of("HEAD")
    chosen = [*CASES, *MORE] if "all" in (options.case or ()) else options.case or list(CASES)
    found = []
    with checkout(options.base) as folder:
        for case in chosen:
            try:
                ratios = paired(folder, case, options.rounds)
            except RuntimeError as error:
                print(f"{case:30} not compared: {error}", flush=True)
                continue
            low, high = interval(ratios)
            regressed = median(ratios) < REGRESSION and high < 1.0
            print(
                f"{case:30} speed of {commits[1]} over {commits[0]}: {median(ratios):.3f} "
                f"[{low:.3f}, {high:.3f}], n = {len(ratios)}{'  REGRESSION' if regressed else ''}",
                flush=True,
            )
            found.append((case, median(ratios), low, high, len(ratios), regressed))
    store(options.store, commits, found)
    sys.exit(1 if any(each[-1] for each in found) else 0)


def store(path: Path, commits: tuple[str, str], found: list[tuple[str, float, float, float, int, bool]]) -> None:
    """Append the results to a CSV file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = not path.exists()
    versions = ", ".join([f"Python {platform.python_version()}", *(f"{each} {version(each)}" for each in LIBRARIES)])
    about = (datetime.now(UTC).isoformat(timespec="seconds"), f"{os.cpu_count()} cores, {platform.machine()}", versions)
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if fresh:
            writer.writerow(
                ["base", "commit", "case", "ratio", "low", "high", "n", "regression", "time", "machine", "versions"]
            )
        for case, ratio, low, high, n, regressed in found:
            writer.writerow([*commits, case, f"{ratio:.4f}", f"{low:.4f}", f"{high:.4f}", n, regressed, *about])


if __name__ == "__main__":
    main()
