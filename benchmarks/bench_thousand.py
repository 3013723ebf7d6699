"""A thousand robot processes on one machine: how long they take to start, what each costs in memory, how fast they go."""

import argparse
import statistics
import time
from pathlib import Path

from zwerm.assembly import assemble
from zwerm.deploy.cast import cast
from zwerm.deploy.swarm import LocalSwarm
from zwerm.running import drive, new_run_id
from zwerm.scenario import load

START_S_MAX, PRIVATE_MB_MAX, RATE_MIN = 45.0, 8.0, 3_000.0


def private_mb(pid: int) -> float:
    """Return the memory [MB] that a process shares with no other (Linux)."""
    fields = (line.split() for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:])
    return sum(int(field[1]) for field in fields if field[0] in ("Private_Clean:", "Private_Dirty:")) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=1000)
    parser.add_argument("--ticks", type=int, default=100)
    options = parser.parse_args()
    side_m = 0.4 * options.robots**0.5
    scenario = load(
        "computation-free",
        (
            f"robots.count={options.robots}",
            f"arena.size_m=[{side_m}, {side_m}]",
            f"time.duration_s={options.ticks * 0.1}",
            "robots.placement={kind='uniform'}",
        ),
    )
    world = assemble(scenario, 1)
    start = time.monotonic()
    with LocalSwarm(new_run_id(), cast(scenario, 1)) as swarm:
        start_s = time.monotonic() - start
        result = drive(world, swarm.link, 1, "processes")
        memory = [private_mb(pid) for pid in swarm.supervisor.pids.values()]
    rate = result.robot_ticks / result.wall_s
    print(f"{options.robots} robot processes, {result.ticks} ticks, outcome {result.outcome}, trace {result.trace}")
    print(f"{'start':<28} {start_s:>8.1f} s   at most {START_S_MAX:g}")
    print(f"{'private memory, mean':<28} {statistics.fmean(memory):>8.2f} MB")
    print(f"{'private memory, largest':<28} {max(memory):>8.2f} MB  at most {PRIVATE_MB_MAX:g}")
    print(f"{'robot-ticks/s':<28} {rate:>8,.0f}     at least {RATE_MIN:g}")
    print(f"{'lost by the middleware':<28} {result.middleware_lost:>8}     exactly 0")


if __name__ == "__main__":
    main()
