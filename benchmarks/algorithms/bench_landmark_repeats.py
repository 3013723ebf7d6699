"""Why robots with a short radio range map more of a hall: what they see while they explore frontiers that others have closed.

A robot observes while it has a frontier to explore. Each observation is *repeated* if the robots together already knew that
frontier to be closed, or another robot explored it before; the robot had not received that. A row compares the completion of
the whole map with that of a map without repeated observations. With `--idle wait` robots without a frontier do not add what
they see to the map (`look_idle=false`). A place is *open* if no robot saw all its landmarks together, and a robot that did
would open a frontier.

    python -m benchmarks.algorithms.bench_landmark_repeats --rows rows.csv --seeds 1 20
"""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from statistics import mean
from typing import Final
from unittest.mock import patch

import msgspec
import numpy as np

from benchmarks.common.campaign import add_campaign_options, carry_out, grouped
from benchmarks.common.csv_rows import write_csv
from zwerm import RunResult, run
from zwerm.agents.landmark_exploration import Explorer
from zwerm.agents.landmark_exploration.mapping.frontier_status import UNKNOWN
from zwerm.agents.landmark_exploration.mapping.landmark_map import LandmarkMap
from zwerm.agents.landmark_exploration.sharing.replica import Stretch
from zwerm.maths.statistics import condense
from zwerm.world.arena.scatter import with_landmarks
from zwerm.world.metrics.landmark_exploration import (
    PLACES_PER_RANGE,
    MapCompletion,
    landmark_range_m,
    places_in,
    visible,
)

SETTINGS: Final = ("services.map=gossip", "services.assignment=claims", "time.duration_s=2000")
RANGES: Final = {"whole hall": (), "0.7 r": ("radio.range_m=0.7",)}
IDLE: Final = {"wait": ("robots.parameters.look_idle=false",), "look": ()}


class Case(msgspec.Struct, frozen=True):
    """One run: its hall, the range of its radio, what robots without a frontier do, and its seed."""

    hall: str
    radio: str
    idle: str
    seed: str


class Recorder:
    """The observations of all robots of an inline run, and the map that they have together.

    `log` holds (landmarks, whether the observation was repeated, whether the robot had a frontier), in the order of the run.
    """

    def __init__(self) -> None:
        self.map = LandmarkMap()
        self.log: list[tuple[tuple[int, ...], bool, bool]] = []
        self._holder: dict[int, list[Explorer]] = {}

    def wrote(self, origin: int, first: int, entries: Sequence[bytes]) -> None:
        """Add entries of a robot to the map of all."""
        self.map.read(Stretch(origin, first, tuple(entries)), first)

    def observed(self, robot: Explorer) -> None:
        """Add the observation of a robot."""
        task = robot._task
        key = None if task is None else task.key
        repeated = False
        if key is not None:
            queue = self._holder.setdefault(key, [])
            queue[:] = [each for each in queue if each._task is not None and each._task.key == key]
            if robot not in queue:
                queue.append(robot)
            repeated = key not in self.map.frontiers.open or queue[0] is not robot
        self.log.append((robot.view.snapshot.landmarks, repeated, key is not None))


@contextmanager
def recorded() -> Iterator[Recorder]:
    """Record the robots of the runs within."""
    recorder = Recorder()
    observe, write = Explorer._observe, Explorer._write

    def recording_observe(self: Explorer) -> None:
        recorder.observed(self)
        observe(self)

    def recording_write(self: Explorer, entries: list[bytes]) -> None:
        recorder.wrote(self._origin, self.replica.vector.get(self._origin, 0), entries)
        write(self, entries)

    with patch.object(Explorer, "_observe", recording_observe), patch.object(Explorer, "_write", recording_write):
        yield recorder


def completion(result: RunResult, seed: int, recorder: Recorder) -> dict[str, str]:
    """Return the completion of the whole map and without repeated observations, and the fraction of places not covered."""
    scenario = result.scenario
    range_m = landmark_range_m(scenario)
    assert range_m is not None
    arena = result.arena
    landmarks = np.array(with_landmarks(scenario, seed).landmarks, dtype=np.float64).reshape(-1, 2)
    whole, once = (MapCompletion(arena, landmarks, range_m) for _ in range(2))
    whole.add({seen for seen, _, _ in recorder.log})
    once.add({seen for seen, repeated, _ in recorder.log if not repeated})
    frontiers, complex_ = recorder.map.frontiers, recorder.map.complex
    left = [seen for seen in visible(arena, landmarks, range_m, places_in(arena, range_m / PLACES_PER_RANGE)) if seen]
    left = [seen for seen in left if not complex_.contains(seen)]
    open_ = [seen for seen in left if any(frontiers.status(a, b) == UNKNOWN for a in seen for b in seen if a != b)]
    return {
        "completion": f"{whole.fraction:.4f}",
        "completion_once": f"{once.fraction:.4f}",
        "not_covered": f"{len(left) / whole.places:.4f}",
        "open_places": f"{len(open_) / whole.places:.4f}",
    }


def one_run(case: Case, more: Sequence[str]) -> dict[str, str]:
    """Carry out one run, and return its row."""
    with recorded() as recorder:
        result = run(case.hall, int(case.seed), "inline", [*SETTINGS, *RANGES[case.radio], *IDLE[case.idle], *more])
    busy = [repeated for _, repeated, has_frontier in recorder.log if has_frontier]
    return {
        **msgspec.structs.asdict(case),
        "outcome": result.outcome,
        "iterations": str(result.ticks),
        **completion(result, int(case.seed), recorder),
        "repeated": f"{mean(busy):.4f}",
        "concluded_early": f"{result.metrics.get('concluded_early', 0.0):g}",
    }


def summary(rows: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """Return one row for each hall, range and rule."""
    groups = grouped(rows, "hall", "radio", "idle")

    def spread(group: Sequence[dict[str, str]], column: str, digits: int) -> str:
        found = condense([float(row[column]) for row in group])
        return f"{found.mean:.{digits}f} ± {found.half_width:.{digits}f}"

    return [
        {
            "hall": hall,
            "range of the radio": radio,
            "robots without a frontier": idle,
            "runs completed": f"{sum(row['outcome'] == 'completed' for row in group)} of {len(group)}",
            "completion": spread(group, "completion", 3),
            "without what was seen again": spread(group, "completion_once", 3),
            "busy ticks at frontiers of others": spread(group, "repeated", 3),
            "places that would open a frontier": spread(group, "open_places", 3),
            "iterations": spread(group, "iterations", 0),
            "concluded early": str(sum(row["concluded_early"] != "0" for row in group)),
        }
        for (hall, radio, idle), group in sorted(
            groups.items(), key=lambda each: (each[0][0], list(IDLE).index(each[0][2]))
        )
    ]


def main() -> None:
    """Run every case with every seed, and print a row each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hall", nargs="+", default=["landmark-free"], metavar="SCENARIO")
    parser.add_argument("--radio", choices=RANGES, nargs="+", default=list(RANGES))
    parser.add_argument("--idle", choices=IDLE, nargs="+", default=list(IDLE))
    add_campaign_options(parser, last_seed=20)
    asked = parser.parse_args()
    cases = (
        Case(hall, radio, idle, str(seed))
        for seed in range(asked.seeds[0], asked.seeds[1] + 1)
        for hall in asked.hall
        for radio in asked.radio
        for idle in asked.idle
    )
    rows = carry_out(asked, cases, lambda case: one_run(case, asked.set))
    write_csv(asked.csv, summary(rows))


if __name__ == "__main__":
    main()
