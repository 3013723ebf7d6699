"""A study or a comparison that is killed at random times: no row may be lost, doubled or different.

The process group of `zwerm study` or `zwerm compare` gets SIGKILL at a random time, then the same command starts again.
After each kill the rows in file and journal are read: none that was there before may be missing. At the end the rows are
those of a command without kills.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.study.rows import Rows

ROOT: Final = Path(__file__).parents[2]
STUDY: Final = """
scenario = "computation-free"
seeds = 1
set = ["time.duration_s={duration_s}"]
metrics = ["cell_coverage_fraction"]
[grid]
"robots.count" = [3, 5]
"""
KINDS: Final = ("study", "comparison")
KEPT: Final = ("variant", "seed", "trace", "cell_coverage_fraction", "outcome", "ticks")


def command(folder: Path, kind: str, out: str, seeds: int, duration_s: float) -> list[str]:
    """Return the command of the study, or of the comparison of the same trials."""
    program = [sys.executable, "-c", "from zwerm.cli.app import main; main()"]
    options = ["--seeds", str(seeds), "--jobs", "2", "--out", str(folder / out), "--json"]
    if kind == "study":
        return [*program, "study", str(folder / "study.toml"), *options]
    variants = ["--variant", "three:robots.count=3", "--variant", "five:robots.count=5"]
    settings = ["--set", f"time.duration_s={duration_s}", "--metrics", "cell_coverage_fraction"]
    return [*program, "compare", "computation-free", *variants, *settings, *options]


def rows_in(path: Path) -> dict[Any, tuple[Any, ...]]:
    """Return the rows in a file and its journal, by key. Raises ValueError if the journal holds a row twice."""
    journal = path.with_name(path.name + ".journal")
    if journal.exists():
        lines = journal.read_bytes().splitlines()
        if len(lines) != len(set(lines)):
            raise ValueError(f"{journal}: a row is there twice")
    with Rows(path) as rows:
        return {key: tuple(row.get(name) for name in KEPT) for key, row in rows.held.items()}


def campaign(kind: str, options: argparse.Namespace) -> list[tuple[str, int, str]]:
    """Kill a command at random times, and return what was counted, each with what is asked for."""
    draw = random.Random(options.seed)
    kills = finished = lost = changed = 0
    before: dict[Any, tuple[Any, ...]] = {}
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "study.toml").write_text(STUDY.format(duration_s=options.duration_s))
        environment = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": name}

        def start(out: str) -> subprocess.Popen[bytes]:
            return subprocess.Popen(
                command(folder, kind, out, options.seeds, options.duration_s),
                cwd=folder,
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )

        path = folder / "killed.parquet"
        while kills < options.kills:
            running = start(path.name)
            try:
                _, said = running.communicate(timeout=draw.uniform(0.0, options.longest_s))
            except subprocess.TimeoutExpired:
                os.killpg(running.pid, signal.SIGKILL)
                running.communicate()
                kills += 1
            else:
                if running.returncode:
                    raise SystemExit(said.decode())
                finished += 1
            found = rows_in(path)
            lost += len(before.keys() - found.keys())
            changed += sum(found[key] != row for key, row in before.items() if key in found)
            before = found
            print(
                f"{kind}: {kills} kills, {finished} finished, {len(found)} rows, {lost} lost, {changed} changed",
                flush=True,
            )
            if len(found) == 2 * options.seeds and kills < options.kills:  # complete: begin again
                path.unlink(missing_ok=True)
                path.with_name(path.name + ".journal").unlink(missing_ok=True)
                before = {}
        for out in (path.name, "whole.parquet"):
            ending = start(out)
            _, said = ending.communicate()
            if ending.returncode:
                raise SystemExit(said.decode())
        whole, last = rows_in(folder / "whole.parquet"), rows_in(path)
        differing = sum(whole.get(key) != last.get(key) for key in whole.keys() | last.keys())
        leftovers = len([each for each in folder.iterdir() if each.name.startswith("zwerm-")])
    return [
        ("kills", kills, ""),
        ("rows lost", lost, "0"),
        ("rows changed", changed, "0"),
        ("rows that differ from a run without kills", differing, "0"),
        ("rows at the end", len(last), str(2 * options.seeds)),
        ("folders left for temporary files", leftovers, "0"),
    ]


def main() -> None:
    """Carry out the campaigns, print their counts, and exit with status 1 where one is not as asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--kills", type=int, default=50, help="the least number of kills")
    parser.add_argument("--seeds", type=int, default=30, help="trials of each of the two points")
    parser.add_argument("--duration-s", type=float, default=60.0, help="virtual time of a trial")
    parser.add_argument("--longest-s", type=float, default=6.0, help="the longest time until a kill")
    parser.add_argument("--seed", type=int, default=1)
    add_csv_option(parser)
    options = parser.parse_args()
    rows = [(kind, *row) for kind in options.kind for row in campaign(kind, options)]
    write_csv(
        options.csv,
        [{"command": kind, "what": what, "measured": str(value), "asked": asked} for kind, what, value, asked in rows],
    )
    for row in rows:
        print(*row, sep="\t")
    if any(asked and str(value) != asked for _, _, value, asked in rows):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
