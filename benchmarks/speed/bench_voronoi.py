"""Speed of Voronoi coverage inline on one core: robots with a control period of 0.02 s.

Prints the factor over real time, and the processor time of one robot's tick [us]. This time is given for the whole
emulator, and for the controller alone with the same observations.
"""

import argparse
import time

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs
from zwerm.maths import cached_voronoi_cell
from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import decode_observation

TARGET = 30.0


def emulator(scenario: Scenario, seed: int) -> tuple[float, float]:
    """Return the factor over real time, and the processor time of one robot's tick [us], of one inline run."""
    start = time.process_time()
    result = run(scenario, seed, "inline")
    spent_s = time.process_time() - start
    return result.sim_s / spent_s, 1e6 * spent_s / result.robot_ticks


def controller(scenario: Scenario, seed: int) -> float:
    """Return the processor time of one step of a controller, without wire format [us]."""
    members = node_specs(scenario, seed)
    nodes = {node: Node(name, setup) for node, (name, setup) in members.items()}
    steps = []
    for node, payload in zip(*assemble(scenario, seed).observe(), strict=True):
        steps.append((nodes[node]._controller.step, decode_observation(payload)))
    start = time.process_time()
    for _ in range(20):
        for step, observation in steps:
            step(observation)
    return 1e6 * (time.process_time() - start) / (20 * len(steps))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--duration_s", type=float, default=20.0, help="virtual time of a run; its start counts")
    parser.add_argument("--code", choices=("interpreted", "compiled"), help="end with an error where it is the other")
    add_csv_option(parser)
    arguments = parser.parse_args()
    code = "interpreted" if cached_voronoi_cell.__file__.endswith(".py") else "compiled"
    if arguments.code not in (None, code):
        parser.error(f"the cell is {code}; for the other run `make -B setup` with or without INTERPRETED=1")
    rows = []
    print(f"best of {arguments.repeats}, the cell {code}")
    print(f"{'robots':>6} {'x real time':>12} {'target':>7} {'us/robot-tick':>14} {'controller us':>14}")
    for count in (10, 100, 1000):
        overrides = (f"robots.count={count}", "time.dt_s=0.02", f"time.duration_s={arguments.duration_s}")
        scenario = load("voronoi-coverage-table1", (*overrides, "robots.parameters.tolerance_m=0.0", "metrics={}"))
        rates = [emulator(scenario, seed) for seed in range(1, arguments.repeats + 1)]
        own = min(controller(scenario, seed) for seed in range(1, arguments.repeats + 1))
        factor, spent = max(rate for rate, _ in rates), min(spent for _, spent in rates)
        print(f"{count:>6} {factor:>12.1f} {TARGET if count == 100 else '':>7} {spent:>14.1f} {own:>14.1f}")
        rows.append(
            {
                "code": code,
                "robots": f"{count}",
                "times real time": f"{factor:.1f}",
                "target": f"{TARGET:g}" if count == 100 else "",
                "µs a robot and tick": f"{spent:.1f}",
                "controller alone [µs]": f"{own:.1f}",
            }
        )
    write_csv(arguments.csv, rows)


if __name__ == "__main__":
    main()
