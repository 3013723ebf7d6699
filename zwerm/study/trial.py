"""One trial of a study: a run in this process, condensed to one row.

A trial that fails is a row like any other, with its outcome and its reason; only an interruption leaves none.
"""

import traceback
from typing import Any, Final

import numpy as np

from zwerm.errors import ZwermError
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.study.plan import Trial
from zwerm.world.drivers.lockstep import FAILED, INTERRUPTED

Row = dict[str, Any]

# A series is sampled at so many even intervals of the run.
SERIES_INTERVALS: Final = 120


def run_trial(trial: Trial) -> Row:
    """Return the row of `trial`.

    Raises KeyboardInterrupt where it is interrupted.
    """
    try:
        result = run(trial.point.scenario, trial.seed, trial.runner)
    except ZwermError as error:
        return failed_row(trial, str(error).replace("\n", "; "))
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return failed_row(trial, f"{type(error).__name__}: {error} ({last.filename}:{last.lineno})")
    if result.outcome == INTERRUPTED:
        raise KeyboardInterrupt
    row = _head(trial) | {
        "outcome": result.outcome,
        "reason": result.reason,
        "trace": result.trace,
        "ticks": result.ticks,
        "sim_s": result.sim_s,
        "wall_s": result.wall_s,
    }
    row |= {name: float(value) for name, value in result.metrics.items()}
    if result.cell_counts is not None:
        row["cell_counts"] = result.cell_counts.ravel().tolist()
    if trial.series:
        row |= _series(result, trial.series)
    return row


def failed_row(trial: Trial, reason: str) -> Row:
    """Return the row of a trial that gave no result."""
    return _head(trial) | {"outcome": FAILED, "reason": reason}


def _head(trial: Trial) -> Row:
    point = trial.point
    return {
        "study": trial.study,
        "variant": point.variant,
        **point.settings,
        "seed": trial.seed,
        "fingerprint": point.fingerprint,
    }


def _series(result: RunResult, names: tuple[str, ...]) -> Row:
    """Return each named series, at even intervals of the scenario's duration, as far as the run went.

    It is a count of robots, or what a meter of the run noted: then the newest at each time, and nothing where none looked.
    """
    tracks = result.history.arrays()
    time_s = np.linspace(0.0, result.scenario.time.duration_s, SERIES_INTERVALS + 1)
    time_s = time_s[time_s <= result.sim_s + 1e-9]
    at = np.searchsorted(tracks.time_s, time_s + 1e-9) - 1
    found = {
        "robots_in_arena": tracks.present.sum(axis=1),
        "robots_entered": np.logical_or.accumulate(tracks.present, axis=0).sum(axis=1),
    }
    noted = {name: np.array(values) for name, values in result.series.items()}
    looks = np.searchsorted(noted["time_s"], time_s + 1e-9) - 1 if noted else at
    series = {
        name: (found[name][at] if name in found else noted[name][looks]) for name in names if name in found | noted
    }
    return {"series_time_s": time_s.tolist()} | {f"{name}_series": values.tolist() for name, values in series.items()}
