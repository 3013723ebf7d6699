"""Speed of the inline runner on one core, compared with the physics engine alone.

Prints robot-ticks per second of processor time. It compares the whole emulator (e-pucks with the line-of-sight sensor,
10 substeps, wire format, trace) with pymunk alone, which steps the same bodies between the same walls.
"""

import argparse
import time

import numpy as np

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario

TARGETS = {25: 170_000, 100: 200_000, 1000: 150_000}
# The shipped arenas have room for this many robots. Larger swarms have a square of 0.16 m2 for each robot, and less time.
SHIPPED_MAX = 100


def emulator_rate(scenario: Scenario, seed: int) -> float:
    """Return robot-ticks per second of processor time of one inline run."""
    start = time.process_time()
    result = run(scenario, seed, "inline")
    return result.robot_ticks / (time.process_time() - start)


def physics_rate(scenario: Scenario, seed: int) -> float:
    """Return robot-ticks per second of pymunk alone, with the wheel speeds of robots that see no other robot."""
    physics = assemble(scenario, seed).bodies.physics
    count = scenario.robots.count
    forward, turn = np.full(count, 0.0725), np.full(count, -0.77)
    ticks = round(scenario.time.duration_s / scenario.time.dt_s)
    start = time.process_time()
    for _ in range(ticks):
        physics.advance(forward, None, turn)
    return count * ticks / (time.process_time() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    add_csv_option(parser)
    options = parser.parse_args()
    repeats, rows = options.repeats, []
    print(f"{'robots':>6} {'emulator/s':>12} {'target/s':>10} {'pymunk alone/s':>15} {'ratio':>6}   ({repeats} runs)")
    for count, target in TARGETS.items():
        name = "computation-free" if count == 25 else "computation-free-scaling"
        settings = [f"robots.count={count}"]
        if count > SHIPPED_MAX:
            side_m = 0.4 * count**0.5
            settings += [
                f"arena.size_m=[{side_m}, {side_m}]",
                "robots.placement={kind='uniform'}",
                "time.duration_s=30",
            ]
        scenario = load(name, tuple(settings))
        rates = [(emulator_rate(scenario, seed), physics_rate(scenario, seed)) for seed in range(1, repeats + 1)]
        emulator, physics = np.array(rates).T
        for label, pick in (("best", np.max), ("median", np.median)):
            ratio = pick(emulator) / pick(physics)
            print(f"{count:>6} {pick(emulator):>12,.0f} {target:>10,} {pick(physics):>15,.0f} {ratio:>6.2f}   {label}")
        measured = {
            "robots": f"{count}",
            "emulator [robot-ticks/s]": f"{np.median(emulator):.0f}",
            "target": f"{target}",
        }
        rows.append(measured | {"pymunk alone, same run [robot-ticks/s]": f"{np.median(physics):.0f}"})
    write_csv(options.csv, rows)


if __name__ == "__main__":
    main()
