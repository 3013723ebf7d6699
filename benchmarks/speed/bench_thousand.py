"""A thousand robot processes on one machine: time to start, memory of each process, and speed.

With `--table1` the robots run Voronoi coverage until each is within 1e-7 m of its centroid (Table I of Schwager,
McLurkin, Rus 2006). With `--hall` a depot of a thousand robots fills a hall by sensor coverage. Both runs are repeated
inline, and must have the same trace. The inline time of a simulated second of the hall is compared with that of the
shipped hall, which 87 robots fill, in the same benchmark.
"""

import argparse
import os
import statistics
import time
from pathlib import Path

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.deploy.node_specs import node_specs
from zwerm.deploy.swarm import LocalSwarm
from zwerm.run.assembly import assemble
from zwerm.run.result import RunResult
from zwerm.run.runner import drive, new_run_id, run
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario

START_S_MAX, PRIVATE_MB_MAX, RATE_MIN = 45.0, 8.0, 3_000.0
# The hall: as the shipped one, 3.15 times as long and as wide. Its packing has 773 robots.
HALL = ("arena.size_m=[28.35, 23.625]", "base.pose=[0.2, 11.8]", "time.duration_s=20000.0")
# Bound of the processor time of a simulated second of the hall, over that of the shipped hall.
HALL_COST_MAX = 12.0


def private_mb(pid: int) -> float:
    """Return the private memory of a process [MB] (Linux)."""
    fields = (line.split() for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:])
    return sum(int(field[1]) for field in fields if field[0] in ("Private_Clean:", "Private_Dirty:")) / 1024


def scenario_of(options: argparse.Namespace) -> Scenario:
    """Return the scenario of the options."""
    if options.table1:
        return load("voronoi-coverage-table1", (f"robots.count={options.robots}", *options.set))
    if options.hall:
        return load("sensor-coverage", (f"robots.count={options.robots}", *HALL, *options.set))
    side_m = 0.4 * options.robots**0.5
    return load(
        "computation-free",
        (
            f"robots.count={options.robots}",
            f"arena.size_m=[{side_m}, {side_m}]",
            f"time.duration_s={options.ticks * 0.1}",
            "robots.placement={kind='uniform'}",
        ),
    )


def report(result: RunResult) -> None:
    """Print the result of a run."""
    print(f"{result.runner}: {result.ticks} ticks, outcome {result.outcome}, trace {result.trace}")
    print(f"{'wall time':<28} {result.wall_s:>8,.1f} s", flush=True)


def timed_inline(scenario: Scenario, seed: int) -> tuple[RunResult, float]:
    """Return an inline run, and its processor time for each simulated second [s]."""
    start = time.process_time()
    result = run(scenario, seed, "inline")
    return result, (time.process_time() - start) / result.sim_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=1000)
    parser.add_argument("--ticks", type=int, default=100)
    tasks = parser.add_mutually_exclusive_group()
    tasks.add_argument("--table1", action="store_true", help="Voronoi coverage")
    tasks.add_argument("--hall", action="store_true", help="sensor coverage")
    parser.add_argument("--set", action="append", default=[], help="override of the scenario of these two")
    parser.add_argument("--seed", type=int, default=1)
    add_csv_option(parser)
    options = parser.parse_args()
    scenario, seed = scenario_of(options), options.seed
    world = assemble(scenario, seed)
    start = time.monotonic()
    with LocalSwarm(new_run_id(), node_specs(scenario, seed)) as swarm:
        start_s = time.monotonic() - start
        result = drive(world, swarm.link, seed, "processes")
        memory = [private_mb(pid) for pid in swarm.supervisor.pids.values()]
    rate = result.robot_ticks / result.wall_s
    report(result)
    print(f"{'start':<28} {start_s:>8.1f} s   at most {START_S_MAX:g}")
    print(f"{'private memory, mean':<28} {statistics.fmean(memory):>8.2f} MB")
    print(f"{'private memory, largest':<28} {max(memory):>8.2f} MB  at most {PRIVATE_MB_MAX:g}")
    print(f"{'private memory, all robots':<28} {sum(memory):>8,.0f} MB")
    print(f"{'private memory, world':<28} {private_mb(os.getpid()):>8,.0f} MB")
    print(f"{'robot-ticks/s':<28} {rate:>8,.0f}     at least {RATE_MIN:g}")
    print(f"{'lost by the middleware':<28} {result.middleware_lost:>8}     exactly 0", flush=True)
    rows = [
        ("start, until all have joined [s]", f"{start_s:.1f}", f"at most {START_S_MAX:g}"),
        ("private memory of a robot, mean [MB]", f"{statistics.fmean(memory):.2f}", f"at most {PRIVATE_MB_MAX:g}"),
        ("private memory of a robot, largest [MB]", f"{max(memory):.2f}", f"at most {PRIVATE_MB_MAX:g}"),
        ("private memory of all robots [MB]", f"{sum(memory):.0f}", ""),
        ("private memory of the world [MB]", f"{private_mb(os.getpid()):.0f}", ""),
        ("robot-ticks/s", f"{rate:.0f}", f"at least {RATE_MIN:g}"),
        ("lost by the middleware", f"{result.middleware_lost}", "0"),
        ("ticks", f"{result.ticks}", ""),
        ("wall time, processes [s]", f"{result.wall_s:.0f}", ""),
    ]
    if options.table1 or options.hall:
        inline, cost_s = timed_inline(scenario, seed)
        report(inline)
        print("the same trace" if inline.trace == result.trace else "ANOTHER TRACE")
        rows.append(("wall time, inline [s]", f"{inline.wall_s:.0f}", ""))
        rows.append(("trace of both", "equal" if inline.trace == result.trace else "different", "equal"))
    if options.hall:
        small, small_cost_s = timed_inline(load("sensor-coverage"), seed)
        ratio = cost_s / small_cost_s
        print(f"a simulated second takes {ratio:.1f} times that of {small.metrics['robots_deployed']:g} robots")
        rows += [
            ("outcome", result.outcome, "completed"),
            ("robots deployed", f"{result.metrics['robots_deployed']:g}", ""),
            ("robots over packing", f"{result.metrics['robots_over_hexagonal']:.3f}", ""),
            ("coverage", f"{result.metrics['reachable_coverage_fraction']:.4f}", ""),
            ("simulated time [s]", f"{result.sim_s:.0f}", ""),
            ("inline, a simulated second over that of 87 robots", f"{ratio:.1f}", f"at most {HALL_COST_MAX:g}"),
        ]
    write_csv(options.csv, [{"what": what, "measured": measured, "target": target} for what, measured, target in rows])


if __name__ == "__main__":
    main()
