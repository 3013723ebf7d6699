"""Lock-step throughput with robots in processes, compared with a bare Zenoh echo of as many processes and bytes.

Both are measured alternately, many times, because the scheduling of a hundred processes on cores changes both rates by a
quarter. The ratio is the median over adjacent pairs of measurements, with the range of its middle half. The emulator's rate
includes physics, sensing, encoding, decoding, controllers and trace. Its robots have a higher niceness than the world; the
last column is the ratio to an echo with the same niceness.
"""

import argparse
import operator
import statistics

from benchmarks.common.csv_rows import add_csv_option, write_csv
from benchmarks.common.echo import echo_rate
from zwerm.agents.runtime.process import NICENESS
from zwerm.deploy.node_specs import node_specs
from zwerm.deploy.swarm import LocalSwarm
from zwerm.run.assembly import assemble
from zwerm.run.runner import drive, new_run_id
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario

TARGETS = {"line of sight": 0.9, "five sensors": 0.8}

# Uniform placement with about eight neighbours in range of each robot, as in a swarm that covers an area.
SENSORS = (
    "arena.size_m=[4.0, 4.0]",
    "robots.placement={kind='uniform'}",
    "robots.sensors=[{kind='line_of_sight'}, {kind='bearings', range_m=0.6}, {kind='touch'}, {kind='odometry'},"
    " {kind='compass'}]",
)


def lockstep_rate(scenario: Scenario, seed: int) -> float:
    """Return robot-ticks per second of one run in processes, without the start of the processes."""
    with LocalSwarm(new_run_id(), node_specs(scenario, seed)) as swarm:
        result = drive(assemble(scenario, seed), swarm.link, seed, "processes")
    if result.middleware_lost or not result.ok:
        raise SystemExit(f"the run failed: {result.outcome}, {result.reason}, {result.middleware_lost} messages lost")
    return result.robot_ticks / result.wall_s


def mean_payload_bytes(scenario: Scenario, seed: int) -> int:
    """Return the mean length of the observations of the first tick [bytes]."""
    world = assemble(scenario, seed)
    _, observations = world.observe()
    return round(statistics.fmean(map(len, observations)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=30.0, help="virtual time of each run")
    parser.add_argument("--repeats", type=int, default=21, help="at least 2")
    add_csv_option(parser)
    options = parser.parse_args()
    rows = []
    base = (f"robots.count={options.robots}", f"time.duration_s={options.seconds}")
    cases = {"line of sight": base, "five sensors": (*base, *SENSORS)}
    print(
        f"{'observation':<14} {'bytes':>6} {'emulator/s':>11} {'echo/s':>9} {'ratio':>6} {'middle half':>14} {'target':>7}"
        f" {'giving way':>11}"
    )
    for name, overrides in cases.items():
        scenario = load("computation-free-scaling", overrides)
        payload_bytes = mean_payload_bytes(scenario, 1)
        ticks = round(options.seconds / scenario.time.dt_s)
        ours, bare, giving_way = [], [], []
        for seed in range(1, options.repeats + 1):
            bare.append(echo_rate(options.robots, ticks, payload_bytes))
            ours.append(lockstep_rate(scenario, seed))
            giving_way.append(echo_rate(options.robots, ticks, payload_bytes, NICENESS))
        low, ratio, high = statistics.quantiles(map(operator.truediv, ours, bare), n=4, method="inclusive")
        fairest = statistics.median(map(operator.truediv, ours, giving_way))
        print(
            f"{name:<14} {payload_bytes:>6} {statistics.median(ours):>11,.0f} {statistics.median(bare):>9,.0f} {ratio:>6.2f}"
            f" {f'{low:.2f} to {high:.2f}':>14} {TARGETS[name]:>7} {fairest:>11.2f}"
        )
        rows.append(
            {
                "observation": name,
                "bytes": f"{payload_bytes}",
                "pairs": f"{options.repeats}",
                "emulator [robot-ticks/s]": f"{statistics.median(ours):.0f}",
                "bare echo [robot-ticks/s]": f"{statistics.median(bare):.0f}",
                "ratio, median": f"{ratio:.2f}",
                "middle half": f"{low:.2f} to {high:.2f}",
                "target": f"{TARGETS[name]}",
                "ratio to an echo of low priority": f"{fairest:.2f}",
            }
        )
    write_csv(options.csv, rows)


if __name__ == "__main__":
    main()
