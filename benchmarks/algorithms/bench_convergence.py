"""Rate of convergence of Voronoi coverage near the optimum, compared with the times of Table I.

Near its optimum a swarm is a linear system: dp/dt = k J (p - p*). J is the derivative of the vectors to the estimated
centroids by the positions. Its slowest mode decays as exp(-rate t), for any integrator and start. Prints that rate, the
rate measured over the last factor of 100 of the mean error, and the rate that the paper's time needs.
"""

import argparse
import math

import numpy as np

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.run.assembly import assemble
from zwerm.scenario.load import load
from zwerm.world.fields.registry import make_field
from zwerm.world.geometry.voronoi_cells import VoronoiCells
from zwerm.world.scene import Floats

GAIN_PER_S = 5.0
STEP_S = 0.1
PAPER_S = {10: 9.56, 100: 25.1, 1000: 19.33}
PAPER_ERROR_M = 1e-7


def converge(coverage: VoronoiCells, position: Floats, error_m: float, longest_s: float) -> tuple[Floats, list[float]]:
    """Return the positions at which the mean error is below `error_m`, and the mean error of each step [m]."""
    errors: list[float] = []
    while len(errors) * STEP_S < longest_s:
        offset = coverage.targets(position)
        errors.append(float(np.hypot(*offset.T).mean()))
        if errors[-1] < error_m:
            break
        position = position + GAIN_PER_S * STEP_S * offset
    return position, errors


def slowest_per_s(coverage: VoronoiCells, position: Floats, by_m: float = 1e-6) -> float:
    """Return the rate of the slowest mode at `position` [1/s], from central differences of `by_m`."""
    columns = []
    for coordinate in range(position.size):
        nudge = np.zeros(position.size)
        nudge[coordinate] = by_m
        nudge = nudge.reshape(position.shape)
        change = coverage.targets(position + nudge) - coverage.targets(position - nudge)
        columns.append(change.ravel() / (2.0 * by_m))
    return float(-GAIN_PER_S * np.linalg.eigvals(np.column_stack(columns)).real.max())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--robots", type=int, nargs="+", default=[10, 100])
    parser.add_argument("--error_m", type=float, default=PAPER_ERROR_M)
    parser.add_argument("--longest_s", type=float, default=2000.0)
    add_csv_option(parser)
    arguments = parser.parse_args()
    rows = []
    print(
        f"{'robots':>6} {'seed':>4} {'converged s':>11} {'measured 1/s':>12} {'slowest 1/s':>11} {'paper needs 1/s':>15}"
    )
    for count in arguments.robots:
        scenario = load("voronoi-coverage-table1", (f"robots.count={count}",))
        for seed in range(1, arguments.seeds + 1):
            world = assemble(scenario, seed)
            assert scenario.field is not None
            field = make_field(scenario.field, world.scene.arena.bounds, scenario.folder, scenario.place)
            coverage = VoronoiCells(world.scene.arena, field)
            position, errors = converge(coverage, world.scene.position, arguments.error_m, arguments.longest_s)
            tail = next(step for step, error in enumerate(errors) if error < 100.0 * errors[-1])
            measured = math.log(errors[tail] / errors[-1]) / ((len(errors) - 1 - tail) * STEP_S)
            needed = math.log(errors[0] / PAPER_ERROR_M) / PAPER_S[count] if count in PAPER_S else math.nan
            slowest = slowest_per_s(coverage, position)
            took = (len(errors) - 1) * STEP_S
            print(f"{count:>6} {seed:>4} {took:>11.1f} {measured:>12.3f} {slowest:>11.3f} {needed:>15.2f}")
            rows.append(
                {
                    "robots": f"{count}",
                    "seed": f"{seed}",
                    "converged after [s]": f"{took:.1f}",
                    "rate over the last factor of 100 [1/s]": f"{measured:.3f}",
                    "rate of the slowest mode [1/s]": f"{slowest:.3f}",
                    "rate that the paper's time needs [1/s]": f"{needed:.2g}",
                }
            )
    write_csv(arguments.csv, rows)


if __name__ == "__main__":
    main()
