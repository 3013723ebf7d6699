"""Run the trials of a study that its file does not have yet, store each row, and summarise all rows.

An interrupted study, or one with new seeds or grid values, continues with the missing trials. Rows of points that are
no longer in the study stay in the file. Rows of a point are replaced if its scenario or code has changed. Rows with
unknown code are never used again.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from joblib import cpu_count

from zwerm.errors import ScenarioError
from zwerm.run.runner import Runner
from zwerm.study.distribute.cluster import run_on_cluster
from zwerm.study.distribute.shard import Shard
from zwerm.study.pool import run_trials
from zwerm.study.rows import Key, Rows, StorageError
from zwerm.study.study_tables import Setting, Study
from zwerm.study.summary import Results
from zwerm.study.trial import Row
from zwerm.study.trial_identity import still_same
from zwerm.study.trial_order import in_order
from zwerm.study.trial_plan import Trial, make_points, make_trials
from zwerm.world.tick.completion import FAILED


class StudyListener(Protocol):
    """Receiver of a study's progress."""

    def begin(self, total: int) -> None:
        """`total` trials will be run."""

    def ended(self, failed: bool) -> None:
        """A trial has ended."""


@dataclass(frozen=True)
class StudyResult:
    """The result of a study: of `planned` trials, `ran` were run now, and `done` are in the file `path`.

    `problems` says in lines why the file is not written; its journal then holds the rows.
    """

    results: Results
    path: Path
    planned: int
    ran: int
    done: int
    interrupted: bool
    problems: tuple[str, ...] = ()

    @property
    def unknown(self) -> list[str]:
        """Code that cannot be known, in words: rows that depend on it are not used again."""
        return list(dict.fromkeys(each for point in self.results.points for each in point.modules.unknown))

    @property
    def failed(self) -> int:
        """Number of failed trials."""
        return self.results.failures.total()


def run_study(
    study: Study,
    out: Path,
    *,
    seeds: Sequence[int] | None = None,
    jobs: int | None = None,
    sets: Sequence[str] = (),
    retry: bool = False,
    timeout_s: float | None = None,
    runner: Runner = "inline",
    listener: StudyListener | None = None,
    shard: Shard | None = None,
    cluster: str = "",
) -> StudyResult:
    """Run the trials of `study` that the file `out` does not have, `jobs` at a time, and return the results.

    `seeds` replaces the study's seeds, `sets` overrides its scenarios, `retry` repeats failed trials. A trial without a
    result after `timeout_s` fails. After Ctrl-C all rows so far are kept, and the result says that it was interrupted.
    With one job trials run in this process, and nothing ends them early. With the runner `processes` one trial runs at
    a time, in the same way. With `shard` only its trials run. With `cluster`, the address of a Dask scheduler, its workers
    run the trials. Raises ScenarioError for errors in the input, before any trial runs.
    """
    if jobs is not None and jobs < 1:
        raise ScenarioError([f"jobs: expected >= 1, got {jobs}"])
    if cluster and (jobs is not None or timeout_s is not None or runner != "inline"):
        raise ScenarioError(
            ["cluster: expected neither jobs nor a timeout nor robot processes: its workers run the trials"]
        )
    points = make_points(study, sets, runner)
    trials = make_trials(study, points, study.table.seeds if seeds is None else seeds, runner)
    with Rows(out) as rows:
        distinct = _distinct(trials)
        if shard is not None:
            distinct = shard.of(distinct)
        for trial in distinct:
            if trial.key in rows.held and not _trusted(trial, rows.held[trial.key]):
                del rows.held[trial.key]
        todo = [trial for trial in distinct if _wanted(rows.held.get(trial.key), retry)]
        ran, interrupted, problems = 0, False, list[str]()
        if listener is not None:
            listener.begin(len(todo))
        try:
            here = runner == "processes" or jobs == 1
            # At least two workers: one job means this process, and a trial that ends its process must not end the study.
            workers = 1 if here else max(2, min(jobs or cpu_count(), len(todo)))
            todo = in_order(todo, rows.held.values(), workers)
            with closing(run_on_cluster(todo, cluster) if cluster else run_trials(todo, workers, timeout_s)) as ending:
                for row in ending:
                    rows.add(row)
                    ran += 1
                    if listener is not None:
                        listener.ended(row["outcome"] == FAILED)
        except KeyboardInterrupt:
            interrupted = True
        except StorageError as error:
            problems += error.mistakes
        axes = list(study.table.grid)
        done = [rows.held[trial.key] for trial in distinct if trial.key in rows.held]
        try:
            rows.merge(axes, _superseded(rows.held, trials, axes))
        except StorageError as error:
            problems += error.mistakes
    found = Results(study, points, done)
    return StudyResult(found, out, len(distinct), ran, len(done), interrupted, tuple(dict.fromkeys(problems)))


def _distinct(trials: Sequence[Trial]) -> list[Trial]:
    """Return each trial once: two settings can give a variant the same scenario."""
    found: dict[Key, Trial] = {}
    for trial in trials:
        found.setdefault(trial.key, trial)
    return list(found.values())


def _trusted(trial: Trial, row: Row) -> bool:
    """Return whether the code that gave a row is known and equals the current code."""
    return not trial.point.modules.unknown and still_same(row.get("modules", ""))


def _wanted(row: Row | None, retry: bool) -> bool:
    return row is None or (retry and row["outcome"] == FAILED)


def _superseded(held: dict[Key, Row], trials: Sequence[Trial], axes: Sequence[str]) -> list[Key]:
    """Return the rows of an earlier scenario whose variant, settings and seed have a new row."""

    def place(variant: str, settings: dict[str, Setting], seed: int) -> tuple[object, ...]:
        return variant, seed, *(settings.get(axis) for axis in axes)

    current = {
        place(trial.point.variant, trial.point.settings, trial.seed): trial.key for trial in trials if trial.key in held
    }
    return [key for key, row in held.items() if current.get(place(row["variant"], row, row["seed"]), key) != key]
