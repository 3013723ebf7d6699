"""Speed of the batch kernel on one core, beside the emulator inline in the same process, and the coverage of both.

Arenas of the scenario `computation-free` alternate with runs of it. The times are processor times. Target: at least 2 million
robot-ticks per second in the batch. The floor is the emulator.
"""

import argparse
import time
from importlib.metadata import version

import numpy as np

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.evolve.batch import Batch
from zwerm.run.runner import run
from zwerm.scenario.load import load

TARGET_PER_S = 2e6
SCENARIOS = ("computation-free", "computation-free-open-loop", "computation-free-greedy")


def main() -> None:
    """Print the rates of each scenario, and the mean coverage of the batch."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arenas", type=int, default=240)
    parser.add_argument("--rounds", type=int, default=3)
    add_csv_option(parser)
    chosen = parser.parse_args()
    print(f"numba {version('numba')}, numpy {version('numpy')}")
    rows = []
    for name in SCENARIOS:
        scenario = load(name)
        batch = Batch(scenario)
        seeds = range(1, chosen.arenas + 1)
        batch.draw_starts(seeds)
        parameters = [scenario.robots.parameters] * chosen.arenas
        result = batch.run(parameters[:1], seeds[:1])  # compiles
        rates: dict[str, list[float]] = {"batch": [], "emulator": []}
        for _ in range(chosen.rounds):
            began_s = time.process_time()
            result = batch.run(parameters, seeds)
            rates["batch"].append(chosen.arenas * batch.ticks * scenario.robots.count / (time.process_time() - began_s))
            began_s = time.process_time()
            ticks = run(scenario, 1, "inline").robot_ticks
            rates["emulator"].append(ticks / (time.process_time() - began_s))
        mine, emulated = max(rates["batch"]), max(rates["emulator"])
        cells = float(np.mean(batch.cell_coverage(result)))
        verdict = "reached" if mine >= TARGET_PER_S else "MISSED"
        print(
            f"{name:28} batch {mine / 1e6:6.2f} million robot-ticks/s, emulator {emulated / 1e6:.3f}, "
            f"{mine / emulated:4.0f} times; cells covered {cells:.3f}; {verdict}"
        )
        rows.append(
            {
                "scenario": name,
                "batch [robot-ticks/s]": f"{mine:.0f}",
                "target": f"{TARGET_PER_S:.0f}",
                "emulator, same run [robot-ticks/s]": f"{emulated:.0f}",
                "batch over emulator": f"{mine / emulated:.0f}",
            }
        )
    write_csv(chosen.csv, rows)


if __name__ == "__main__":
    main()
