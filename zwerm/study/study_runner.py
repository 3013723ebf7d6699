"""Running a study: what is not yet in its file is run, kept row by row, and condensed.

A study that was cut short, or whose seeds or grid have grown, goes on where it was. What the file holds of points that the
study no longer has stays there; rows of a point whose scenario has changed make room for new ones.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from joblib import cpu_count

from zwerm.errors import ScenarioError
from zwerm.run.runner import Runner
from zwerm.study.plan import Trial, make_points, make_trials
from zwerm.study.pool import run_trials
from zwerm.study.rows import Key, Rows
from zwerm.study.summary import Results
from zwerm.study.tables import Setting, Study
from zwerm.study.trial import Row
from zwerm.world.drivers.lockstep import FAILED


class StudyListener(Protocol):
    """Somebody to tell how a study is getting on."""

    def begin(self, total: int) -> None:
        """`total` trials are to be run."""

    def ended(self, failed: bool) -> None:
        """A trial has ended."""


@dataclass(frozen=True)
class StudyResult:
    """What a study has come to: `planned` trials, of which `ran` were run now and `done` are in the file `path`."""

    results: Results
    path: Path
    planned: int
    ran: int
    done: int
    interrupted: bool

    @property
    def failed(self) -> int:
        """How many of the trials that are done have failed."""
        return self.results.failures.total()


def run_study(
    study: Study,
    out: Path,
    *,
    seeds: Sequence[int] | None = None,
    jobs: int | None = None,
    sets: Sequence[str] = (),
    retry: bool = False,
    runner: Runner = "inline",
    watcher: StudyListener | None = None,
) -> StudyResult:
    """Run what `out` does not hold yet of `study`, `jobs` trials at a time, and return what is known then.

    `seeds` replaces the study's own, `sets` overrides its scenarios, `retry` runs trials again that failed. Ctrl-C keeps
    every row that is done, and is told by the result. In `processes`, a trial has the machine for itself. Raises
    ScenarioError for mistakes, before anything is run.
    """
    if jobs is not None and jobs < 1:
        raise ScenarioError([f"jobs: expected >= 1, got {jobs}"])
    points = make_points(study, sets)
    trials = make_trials(study, points, study.table.seeds if seeds is None else seeds, runner)
    with Rows(out) as rows:
        distinct = _distinct(trials)
        todo = [trial for trial in distinct if _wanted(rows.held.get(trial.key), retry)]
        ran, interrupted = 0, False
        if watcher is not None:
            watcher.begin(len(todo))
        try:
            workers = 1 if runner == "processes" else min(jobs or cpu_count(), max(1, len(todo)))
            with closing(run_trials(todo, workers)) as ending:
                for row in ending:
                    rows.add(row)
                    ran += 1
                    if watcher is not None:
                        watcher.ended(row["outcome"] == FAILED)
        except KeyboardInterrupt:
            interrupted = True
        axes = list(study.table.grid)
        done = [rows.held[trial.key] for trial in distinct if trial.key in rows.held]
        rows.merge(axes, _superseded(rows.held, trials, axes))
    return StudyResult(Results(study, points, done), out, len(distinct), ran, len(done), interrupted)


def _distinct(trials: Sequence[Trial]) -> list[Trial]:
    """Return each trial once: a setting may do nothing to a variant, as a coordinator's crash to one that has none."""
    found: dict[Key, Trial] = {}
    for trial in trials:
        found.setdefault(trial.key, trial)
    return list(found.values())


def _wanted(row: Row | None, retry: bool) -> bool:
    return row is None or (retry and row["outcome"] == FAILED)


def _superseded(held: dict[Key, Row], trials: Sequence[Trial], axes: Sequence[str]) -> list[Key]:
    """Return the rows that stand in the place of a trial which is done, and are of an earlier scenario."""

    def place(variant: str, settings: dict[str, Setting], seed: int) -> tuple[object, ...]:
        return variant, seed, *(settings.get(axis) for axis in axes)

    current = {
        place(trial.point.variant, trial.point.settings, trial.seed): trial.key for trial in trials if trial.key in held
    }
    return [key for key, row in held.items() if current.get(place(row["variant"], row, row["seed"]), key) != key]
