"""Cost of the radio models: 100 robots broadcast at every tick, without models and with five models.

In half of the runs the robots drive, which changes every distance and line of sight at every tick. The kinds of run
alternate in this process, so that other load slows all of them; the fastest run of each kind counts. Target: five
models reduce the robot-ticks per second by at most 25 %.
"""

import argparse
import time
from dataclasses import dataclass

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.run.runner import run

FIVE_MODELS = (
    'radio.models=[{kind="range", range_m=9}, {kind="line_of_sight"}, {kind="loss", fraction=0.1}, '
    '{kind="gilbert_elliott", loss_fraction=0.1, burst_packets=4}, {kind="delay", jitter_s=0.1, distribution="exponential"}]'
)
SAME_DELIVERY = (
    'radio.models=[{kind="range", range_m=99}, {kind="path_loss", tx_power_dbm=60.0}, {kind="loss", fraction=0.0}, '
    '{kind="gilbert_elliott", loss_fraction=1e-9, burst_packets=4}, {kind="delay", delay_s=0.1}]'
)
TARGET_LOSS = 0.25


@dataclass
class Measured:
    """Result of the fastest of several runs."""

    rate: float = 0.0
    delivered: float = 0.0


def measure(overrides: list[str], robots: int, seconds: float, speed_m_s: float) -> Measured:
    """Return robot-ticks per second of processor time, and the delivered fraction."""
    table = [
        f"robots.parameters.speed_m_s={speed_m_s}",
        f"robots.count={robots}",
        f"time.duration_s={seconds}",
        "arena.size_m=[12, 12]",
        *overrides,
    ]
    began_s = time.process_time()
    result = run("beacon", seed=1, runner="inline", overrides=["arena.walls=[[[6, 0], [6, 5]]]", *table])
    spent_s = time.process_time() - began_s
    return Measured(result.robot_ticks / spent_s, result.radio["delivered"] / result.radio["sent"])


def main() -> None:
    """Print the rates and their reduction by the models."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--rounds", type=int, default=5)
    add_csv_option(parser)
    chosen = parser.parse_args()
    rows = []
    kinds = {"perfect": ["radio.models=[]"], "five models": [FIVE_MODELS], "five models, none lost": [SAME_DELIVERY]}
    for speed_m_s in (0.0, 0.1):
        best = {name: Measured() for name in kinds}
        for _ in range(chosen.rounds):
            for name, overrides in kinds.items():
                measured = measure(overrides, chosen.robots, chosen.seconds, speed_m_s)
                if measured.rate > best[name].rate:
                    best[name] = measured
        perfect = best["perfect"].rate
        print(f"robots that drive at {speed_m_s:g} m/s")
        for name, each in best.items():
            lost = 1.0 - each.rate / perfect
            print(f"  {name:24} {each.rate:9,.0f} robot-ticks/s, {each.delivered:5.1%} delivered, {lost:6.1%} off")
            rows.append(
                {
                    "radio": name,
                    "robots drive [m/s]": f"{speed_m_s:g}",
                    "delivered [%]": f"{100.0 * each.delivered:.1f}",
                    "robot-ticks/s": f"{each.rate:.0f}",
                    "slower [%]": f"{100.0 * lost:.1f}",
                    "at most [%]": f"{100.0 * TARGET_LOSS:g}" if name == "five models" else "",
                }
            )
        loss = 1.0 - best["five models"].rate / perfect
        print(f"  target: at most {TARGET_LOSS:.0%} off; {'met' if loss <= TARGET_LOSS else 'missed'}")
    write_csv(chosen.csv, rows)


if __name__ == "__main__":
    main()
