"""Time that the coordinator of sensor coverage takes to continue after it was killed and started again without memory.

The coordinator is killed at several times and returns after 3 s. The time is measured from its return to the first complex that
it reports, by the snapshots of the run. Then the next push begins.
"""

import argparse
from typing import Final

import numpy as np

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.agents.sensor_coverage.messages.snapshots import ComplexSnapshot, decode_snapshot
from zwerm.run.runner import run

HALL: Final = ("arena.size_m=[2.2,1.7]", "base.pose=[0.2,0.85,0.0]", "robots.count=20")
DEATHS_S: Final = (14.3, 23.7, 33.3, 47.5, 58.4)
AWAY_S: Final = 3.0
NOISE: Final = "robots.sensors.0.sd_rad=0.0436332"


def seconds_until_known(at_s: float, settings: tuple[str, ...]) -> float:
    """Return the seconds from the coordinator's return to its first complex, in a run in which it dies at `at_s`."""
    fault = f'faults=[{{kind="crash", nodes=["coordinator"], at_s={at_s}, for_s={AWAY_S}}}]'
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, *settings, fault])
    back_s = at_s + AWAY_S
    for each in result.snapshots:
        if each.time_s >= back_s and isinstance(decode_snapshot(each.snapshot), ComplexSnapshot):
            return each.time_s - back_s
    raise SystemExit(f"the coordinator that died at {at_s} s reported no complex: {result.outcome} {result.reason}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_csv_option(parser)
    options = parser.parse_args()
    rows = []
    for loss in (0.0, 0.3, 0.5):
        for noise, settings in (("none", ()), ("π/72", (NOISE,))):
            air = (f"radio.loss={loss}", f"uplink.loss={loss}") if loss else ()
            times_s = [seconds_until_known(at_s, (*settings, *air)) for at_s in DEATHS_S]
            row = {"messages lost": f"{loss:g}", "noise of bearings": noise}
            row |= {"complex known again after [s], mean": f"{np.mean(times_s):.2f}", "most": f"{max(times_s):.2f}"}
            rows.append(row)
            print(row, flush=True)
    write_csv(options.csv, rows)


if __name__ == "__main__":
    main()
