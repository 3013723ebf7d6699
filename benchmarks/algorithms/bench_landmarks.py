"""Landmark-based exploration of a building that grows with the robots: whether it completes, and the cost of a tick.

The building is the office floor of `landmark-complex`, set side by side as often as there are 30 robots, and open from floor to
floor: 300 robots have 10 times its area and landmarks. Prints the iterations, the completion, and the processor time of a
tick by robots, inline on one core, and the exponent of that cost in robots. `--ticks` ends runs early.
"""

import argparse
import json
import math
import time
from typing import Any, Final

import numpy as np

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm import run
from zwerm.scenario.load import load

SCENARIO: Final = "landmark-complex"
ROBOTS: Final = 30
COUNTS: Final = (30, 90, 300)
ROWS: Final = 2  # floors above each other in the largest building
TICKS_MAX: Final = 30_000  # 300 robots need more than 12,000


def settings(count: int, ticks: int) -> list[str]:
    """Return the settings of the scenario for `count` robots, a multiple of ROBOTS."""
    scenario = load(SCENARIO)
    width_m, height_m = scenario.arena.size_m
    floors = count // ROBOTS
    rows = ROWS if floors % ROWS == 0 else 1
    columns = floors // rows
    places = [(width_m * (each % columns), height_m * (each // columns)) for each in range(floors)]
    obstacles = [
        [[round(x + dx, 6), round(y + dy, 6)] for x, y in obstacle]
        for dx, dy in places
        for obstacle in scenario.arena.obstacles
    ]
    return [
        f"robots.count={count}",
        f"robots.parameters.robots_expected={count}",
        f"arena.size_m=[{width_m * columns}, {height_m * rows}]",
        f"arena.obstacles={json.dumps(obstacles)}",
        f"time.duration_s={ticks * scenario.time.dt_s}",
        "time.straggler_s=3600",  # on a busy machine one tick of the coordinator may take long
    ]


def measured(count: int, ticks: int, seed: int) -> dict[str, Any]:
    """Run `count` robots, and return a row of the table."""
    ends: list[float] = []

    class Clock:
        def joined(self, count: int, total: int) -> None:
            ends.append(time.process_time())

        def ticked(self, tick: int, ticks: int) -> None:
            ends.append(time.process_time())

        def covered(self, fraction: float, robots: int) -> None:
            pass

    result = run(SCENARIO, seed, "inline", settings(count, ticks), watcher=Clock())
    metrics = result.metrics
    return {
        "robots": count,
        "landmarks": int(metrics["landmarks"]),
        "outcome": result.outcome,
        "iterations": result.ticks,
        "completion": round(metrics["completion_fraction"], 4),
        "reason": result.reason,
        "holes of the complex": int(metrics["landmark_complex_holes"]),
        "obstacles": int(metrics["obstacles"]),
        "processor time [s]": round(ends[-1] - ends[0], 1),
        "processor time of a tick [ms]": round(1e3 * (ends[-1] - ends[0]) / result.ticks, 3),
    }


def exponent(rows: list[dict[str, Any]]) -> float:
    """Return the slope of the line through the logarithms of cost and robots, by least squares."""
    if len(rows) < 2:
        return math.nan
    cost = [row["processor time of a tick [ms]"] for row in rows]
    return float(np.polyfit(np.log([row["robots"] for row in rows]), np.log(cost), 1)[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--counts", type=int, nargs="+", default=list(COUNTS), help=f"multiples of {ROBOTS}")
    parser.add_argument(
        "--ticks", type=int, default=TICKS_MAX, help="end each run after this many ticks, if not all is explored before"
    )
    parser.add_argument("--seed", type=int, default=1)
    add_csv_option(parser)
    options = parser.parse_args()
    if any(count < ROBOTS or count % ROBOTS for count in options.counts):
        parser.error(f"--counts: expected multiples of {ROBOTS}, got {options.counts}")
    rows = []
    for count in options.counts:
        rows.append(measured(count, options.ticks, options.seed))
        print(", ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    print(f"exponent of the cost in robots: {exponent(rows):.2f}")
    write_csv(options.csv, rows)


if __name__ == "__main__":
    main()
