"""A long run in real time: memory and open descriptors of the world and of its robots, while robots crash and restart.

Robots gossip over a lossy radio, 10 ticks a second. In every minute three robots crash for 20 s, and two are restarted at
once. Only robots of the first half are struck, so the second half shows processes that live for the whole run. A sample
is taken every 10 s, and written to the series at once. The trend is the slope of a line through the second half of the
samples, with its 95 % interval. Samples that follow each other are alike, so they count as fewer, by their correlation.

With `--lock-step` the run is not paced, and its times are virtual: other work on the machine then has no effect on memory.
In real time a world that is delayed gets the answers of many ticks at once, and its tables grow to the largest number.
"""

import argparse
import csv
import ctypes
import math
import os
import statistics
import sys
import threading
import time
from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.run.result import RunResult
from zwerm.run.runner import run

MINUTE_S: Final = 60.0
TICK_S: Final = 0.1
CRASHED: Final = 3
RESTARTED: Final = 2
STEP: Final = 7  # the next minute strikes other robots
DOWN_S: Final = 20.0
NEIGHBOURS: Final = 8.0
RANGE_M: Final = 1.0
MEBIBYTE: Final = 2**20
PAGE_BYTES: Final = os.sysconf("SC_PAGE_SIZE")

# Greatest trends that count as flat. The positions for pictures fill their blocks in the first half of a run.
WORLD_MB_PER_H_MAX: Final = 2.0
ROBOT_MB_PER_H_MAX: Final = 1.0
DESCRIPTORS_PER_H_MAX: Final = 1.0
SAMPLES_MIN: Final = 4


def settings(robots: int, duration_s: float) -> list[str]:
    """Return the settings of the run, its faults among them."""
    side_m = (robots * np.pi * RANGE_M**2 / NEIGHBOURS) ** 0.5
    struck = robots // 2
    faults = []
    for minute in range(int(duration_s // MINUTE_S)):
        chosen = [(minute * STEP + number) % struck for number in range(CRASHED + RESTARTED)]
        begin_s = minute * MINUTE_S
        faults.append(f'{{kind="crash", nodes={chosen[:CRASHED]}, at_s={begin_s + 10.0}, for_s={DOWN_S}}}')
        faults.append(f'{{kind="restart", nodes={chosen[CRASHED:]}, at_s={begin_s + 45.0}}}')
    return [
        f"robots.count={robots}",
        "robots.parameters={every_ticks=5}",
        "robots.placement={kind='uniform'}",
        f"arena.size_m=[{side_m:.2f}, {side_m:.2f}]",
        f"radio.range_m={RANGE_M}",
        f"time.duration_s={duration_s}",
        f"faults=[{', '.join(faults)}]",
    ]


def parents() -> dict[int, int]:
    """Return the parent of every living process of this machine."""
    found = {}
    for name in filter(str.isdecimal, os.listdir("/proc")):  # noqa: PTH208 - see `content_of`
        try:
            state, parent = content_of(f"/proc/{name}/stat").rpartition(")")[2].split()[:2]
        except OSError:  # it has ended
            continue
        if state != "Z":
            found[int(name)] = int(parent)
    return found


def content_of(path: str) -> str:
    """Return the content of a file.

    Without `pathlib`, which enters each name of a path into Python's table of names: many samples would let that grow.
    """
    with open(path) as file:  # noqa: PTH123 - see above
        return file.read()


def own_robots() -> list[int]:
    """Return the ids of the robot processes: the grandchildren of this process."""
    of = parents()
    return [pid for pid, parent in of.items() if of.get(parent) == os.getpid()]


def memory_mb(pid: int) -> float:
    """Return the resident memory of a process that no file backs [MB]."""
    _, resident, shared, *_ = map(int, content_of(f"/proc/{pid}/statm").split())
    return (resident - shared) * PAGE_BYTES / MEBIBYTE


def descriptors(pid: int) -> int:
    """Return the number of open descriptors of a process. For robots this needs root, because they hide from their user."""
    return len(os.listdir(f"/proc/{pid}/fd"))  # noqa: PTH208 - see `content_of`


class _MallocInfo(ctypes.Structure):
    """The C library's `struct mallinfo2`: sizes [bytes] of its heaps together."""

    _names = ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost")
    _fields_: ClassVar = [(name, ctypes.c_size_t) for name in _names]


_READ_HEAPS: Final = ctypes.CDLL(None).mallinfo2  # opened once: each opening leaves a cycle of objects
_READ_HEAPS.restype = _MallocInfo


def heap_mb() -> tuple[float, float]:
    """Return the memory of this process that the C library's heaps have lent, and what they keep free [MB]."""
    found = _READ_HEAPS()
    return (found.uordblks + found.hblkhd) / MEBIBYTE, found.fordblks / MEBIBYTE


def sample(time_s: float, first: Sequence[int]) -> dict[str, float]:
    """Measure all processes; `first` are the robots of the beginning, of which some still live."""
    memory: dict[int, float] = {}
    opened: list[int] = []
    for pid in own_robots():
        try:
            memory[pid] = memory_mb(pid)
            opened.append(descriptors(pid))
        except PermissionError:
            pass
        except OSError:  # it has just ended
            memory.pop(pid, None)
    old = [memory[pid] for pid in first if pid in memory] or list(memory.values()) or [0.0]
    me = os.getpid()
    return {
        "time_s": time_s,
        "world_mb": memory_mb(me),
        "heap_used_mb": heap_mb()[0],
        "heap_free_mb": heap_mb()[1],
        "python_blocks": sys.getallocatedblocks(),
        "world_descriptors": descriptors(me),
        "world_threads": len(os.listdir(f"/proc/{me}/task")),  # noqa: PTH208 - see `content_of`
        "robots": len(memory),
        "robot_mb_mean": statistics.fmean(memory.values() or [0.0]),
        "robot_mb_max": max(memory.values(), default=0.0),
        "old_robots": len(old),
        "old_robot_mb_mean": statistics.fmean(old),
        "robot_descriptors_max": max(opened, default=0),
    }


class Sampler:
    """Samples this process and its robots, and writes each sample to `path` at once.

    `tick_s` is the duration of a tick. Samples are taken every `every_s` of the wall clock, in a thread of their own; of
    virtual time where the run is not `paced`.
    """

    def __init__(self, path: Path | None, every_s: float, tick_s: float, *, paced: bool = True) -> None:
        self._names: list[str] = []
        self._values = array("d")  # of all samples: a dictionary for each would grow by 0.4 MB an hour
        self._tick_s = tick_s
        self._paced = paced
        self._taken = 0
        self._slip_s = 0.0  # the longest time by which a tick was behind, since the last sample
        self._begin_s = math.inf
        self._first: Sequence[int] = ()
        self._path = path
        self._every_s = every_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, name="sampler")

    @property
    def samples(self) -> list[dict[str, float]]:
        """The samples so far."""
        width = len(self._names)
        rows = (self._values[at : at + width] for at in range(0, len(self._values), width or 1))
        return [dict(zip(self._names, row, strict=True)) for row in rows]

    def joined(self, count: int, total: int) -> None:
        """Begin when all robots have joined."""
        if count == total:
            self._first = own_robots()
            if self._paced:
                self._thread.start()

    def ticked(self, tick: int, ticks: int) -> None:
        """Take a sample where one is due by virtual time."""
        behind_s = time.monotonic() - tick * self._tick_s
        self._begin_s = min(self._begin_s, behind_s)
        self._slip_s = max(self._slip_s, behind_s - self._begin_s)
        if not self._paced and tick * self._tick_s >= (self._taken + 1) * self._every_s:
            self._sample(tick * self._tick_s)

    def covered(self, fraction: float, robots: int) -> None:
        """Ignore the coverage."""

    def stop(self) -> None:
        """Take no more samples."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _work(self) -> None:
        begin_s = time.monotonic()
        while not self._stop.wait(self._every_s):
            self._sample(time.monotonic() - begin_s)

    def _sample(self, time_s: float) -> None:
        slip_s, self._slip_s = self._slip_s, 0.0
        taken = sample(round(time_s, 1), self._first) | {"slip_s": slip_s}
        self._names = list(taken)
        self._values.extend(taken.values())
        self._taken += 1
        if self._path is not None:
            with self._path.open("a", encoding="utf-8", newline="") as file:
                writer = csv.DictWriter(file, self._names, lineterminator="\n")
                if self._taken == 1:
                    writer.writeheader()
                writer.writerow({name: f"{value:.6g}" for name, value in taken.items()})


def trend_per_h(samples: Sequence[dict[str, float]], name: str) -> tuple[float, float]:
    """Return the slope of a line through the second half of the samples, per hour, and half its 95 % interval."""
    half = samples[len(samples) // 2 :]
    if len(half) < SAMPLES_MIN:
        return 0.0, math.inf
    time_h = np.array([each["time_s"] for each in half]) / 3_600.0
    values = np.array([each[name] for each in half])
    line = np.polynomial.Polynomial.fit(time_h, values, 1).convert()
    rest = values - line(time_h)
    if not rest.any():
        return float(line.coef[-1]), 0.0
    alike = max(0.0, float(rest[:-1] @ rest[1:] / (rest @ rest)))  # autocorrelation at lag one
    counted = max(SAMPLES_MIN, len(half) * (1.0 - alike) / (1.0 + alike))
    error = math.sqrt(rest @ rest / len(half) / (counted - 2.0)) / float(time_h.std())
    return float(line.coef[-1]), 1.96 * error


def rows_of(result: RunResult, samples: Sequence[dict[str, float]]) -> list[dict[str, str]]:
    """Return what was measured, one row each: the value at the beginning, at the end, the largest, and what is asked for."""
    half = samples[len(samples) // 2 :]

    def row(what: str, name: str, digits: int, asked: str) -> dict[str, Any]:
        values = [each[name] for each in half]
        return {
            "what": what,
            "half time": f"{values[0]:.{digits}f}",
            "end": f"{values[-1]:.{digits}f}",
            "largest": f"{max(each[name] for each in samples):.{digits}f}",
            "trend per hour": "{:+.2f} ± {:.2f}".format(*trend_per_h(samples, name)),
            "asked": asked,
        }

    def count(what: str, value: float, asked: str = "") -> dict[str, Any]:
        return {"what": what, "half time": "", "end": f"{value:g}", "largest": "", "trend per hour": "", "asked": asked}

    return [
        row("memory of the world [MB]", "world_mb", 1, f"trend at most {WORLD_MB_PER_H_MAX:g}"),
        row("heap of the world in use [MB]", "heap_used_mb", 1, ""),
        row("descriptors of the world", "world_descriptors", 0, "no trend"),
        row("threads of the world", "world_threads", 0, "no trend"),
        row(
            "memory of robots that live on, mean [MB]", "old_robot_mb_mean", 2, f"trend at most {ROBOT_MB_PER_H_MAX:g}"
        ),
        row("memory of a robot, largest [MB]", "robot_mb_max", 2, ""),
        row("descriptors of a robot, most", "robot_descriptors_max", 0, "no trend"),
        count("wall time [s]", round(result.wall_s)),
        count("longest delay of a tick [s]", round(max((each["slip_s"] for each in samples), default=0.0), 2)),
        count("ticks", result.ticks),
        count("observations", result.robot_ticks),
        count("radio packets delivered", result.radio["delivered"]),
        count(
            f"robots that crashed or restarted, of {result.robots}", len(set(result.crashed) | set(result.restarted))
        ),
        count("lost by the middleware", result.middleware_lost, "0"),
        count("refused messages", result.metrics["refused_messages"]),
        *(
            count(what, result.metrics[name])
            for what, name in (("late commands", "late_commands"), ("late ticks", "tick_overruns"))
            if name in result.metrics
        ),
    ]


def main() -> None:
    """Run, and print a row for each thing measured. Exits with status 1 where something grows, or was lost."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--lock-step", action="store_true", help="do not pace the run; times are virtual")
    parser.add_argument("--tick-s", type=float, default=TICK_S, help="the duration of a tick [s]")
    parser.add_argument("--every-s", type=float, default=10.0, help="seconds between samples")
    parser.add_argument("--series", type=Path, metavar="FILE", help="write every sample to this CSV file")
    add_csv_option(parser)
    options = parser.parse_args()
    if options.series is not None:
        options.series.unlink(missing_ok=True)
    sampler = Sampler(options.series, options.every_s, options.tick_s, paced=not options.lock_step)
    duration_s = options.minutes * MINUTE_S
    asked, pace = (
        [*settings(options.robots, duration_s), f"time.dt_s={options.tick_s}"],
        None if options.lock_step else 1.0,
    )
    try:
        result = run("gossip-max", runner="processes", overrides=asked, realtime=pace, watcher=sampler)
    finally:
        sampler.stop()
    rows = rows_of(result, sampler.samples)
    for row in rows:
        print(*row.values(), sep="\t", flush=True)
    write_csv(options.csv, rows)
    left = own_robots()
    bounds = {
        "world_mb": WORLD_MB_PER_H_MAX,
        "old_robot_mb_mean": ROBOT_MB_PER_H_MAX,
        "world_descriptors": DESCRIPTORS_PER_H_MAX,
    }
    trends = {name: trend_per_h(sampler.samples, name) for name in bounds}
    grown = [name for name, (trend, interval) in trends.items() if trend - interval > bounds[name]]
    print(f"outcome {result.outcome} {result.reason}; robots left {len(left)}; grown {grown}")
    if not result.ok or result.middleware_lost or left or grown:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
