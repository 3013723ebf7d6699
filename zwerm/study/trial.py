"""One trial of a study: a run and its row of results.

A failed trial gives a row too, with its outcome and reason. Only an interrupted trial gives none.
"""

import traceback
from typing import Any, Final

import numpy as np

from zwerm.errors import ZwermError
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.study.trial_identity import LoadedModules
from zwerm.study.trial_plan import Trial
from zwerm.world.tick.completion import FAILED, INTERRUPTED

Row = dict[str, Any]

# Number of equal intervals at which a series is sampled.
SERIES_INTERVALS: Final = 120


def run_trial(trial: Trial) -> Row:
    """Return the row of `trial`. A trial whose modules changed since the study was planned has failed.

    Raises KeyboardInterrupt if the run is interrupted.
    """
    loaded = LoadedModules(trial.point.modules, in_processes=trial.runner == "processes")
    try:
        result = run(trial.point.scenario, trial.seed, trial.runner)
    except ZwermError as error:
        return failed_row(trial, str(error).replace("\n", "; "))
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return failed_row(trial, f"{type(error).__name__}: {error} ({last.filename}:{last.lineno})")
    if result.outcome == INTERRUPTED:
        raise KeyboardInterrupt
    if changed := loaded.changed():
        return failed_row(trial, f"{changed} changed while the study ran")
    row = _head(trial) | {
        "outcome": result.outcome,
        "reason": result.reason,
        "trace": result.trace,
        "ticks": result.ticks,
        "sim_s": result.sim_s,
        "wall_s": result.wall_s,
    }
    if others := loaded.others():
        row["modules"] = others
    row |= {name: float(value) for name, value in result.metrics.items()}
    if result.cell_counts is not None:
        row["cell_counts"] = result.cell_counts.ravel().tolist()
    if trial.series:
        row |= _series(result, trial.series)
    return row


def failed_row(trial: Trial, reason: str) -> Row:
    """Return the row of a trial without a result."""
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
    """Return each named series at equal intervals of the scenario's duration, up to the end of the run.

    A series is a count of robots, or the newest sample of an observer at each time. A series without samples is left out.
    """
    tracks = result.history.arrays()
    time_s = np.linspace(0.0, result.scenario.time.duration_s, SERIES_INTERVALS + 1)
    time_s = time_s[time_s <= result.sim_s + 1e-9]
    at = np.searchsorted(tracks.time_s, time_s + 1e-9) - 1
    found = {
        "robots_in_arena": tracks.present.sum(axis=1),
        "robots_entered": np.logical_or.accumulate(tracks.present, axis=0).sum(axis=1),
    }
    sampled = {name: np.array(values) for name, values in result.series.items()}
    newest = np.searchsorted(sampled["time_s"], time_s + 1e-9) - 1 if sampled else at
    series = {
        name: (found[name][at] if name in found else sampled[name][newest]) for name in names if name in found | sampled
    }
    return {"series_time_s": time_s.tolist()} | {f"{name}_series": values.tolist() for name, values in series.items()}
