"""Run trials on a Dask cluster: one task a trial, each on any worker.

Dask repeats a trial whose worker dies, and a row is taken once from each task. So no row is lost or doubled. A trial with which
several workers die becomes a failed row. Workers must have the same release of Zwerm and of its libraries, and see the
user's modules under the same paths.
"""

import threading
from collections.abc import Generator, Sequence
from typing import Any, Final

from zwerm.errors import LinkError, MissingExtraError, ScenarioError
from zwerm.study.trial import Row, failed_row, run_trial
from zwerm.study.trial_identity import library_versions, zwerm_identity
from zwerm.study.trial_plan import Trial

_JOIN_S: Final = 10.0

# A worker with several threads would run several trials in one process, which share the state of the user's modules.
_one_at_a_time = threading.Lock()


def run_on_cluster(trials: Sequence[Trial], address: str) -> Generator[Row, None, None]:
    """Yield the row of every trial as it ends. Close the iterator to stop early: the remaining tasks are cancelled.

    Raises MissingExtraError without Dask, LinkError where no scheduler answers at `address`, and ScenarioError where a worker
    has other code.
    """
    try:
        from distributed import Client
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            f"--cluster: needs {error.name}; install it with: pip install 'zwerm[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=_JOIN_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise LinkError(f"--cluster {address}: no Dask scheduler answers: {type(error).__name__}") from None
    try:
        yield from _rows(client, trials)
    finally:
        client.close()


def _rows(client: Any, trials: Sequence[Trial]) -> Generator[Row, None, None]:
    from distributed import as_completed

    libraries = library_versions()
    tasks: dict[Any, Trial] = {}
    for index, trial in enumerate(trials):
        code = zwerm_identity(trial.point.scenario)
        # Earlier trials first. A trial is a function of its arguments, but its row is wanted of this study only.
        task = client.submit(_work, trial, code, libraries, priority=-index, pure=False)
        tasks[task] = trial
    try:
        for task in as_completed(list(tasks), loop=client.loop):
            yield _row(task, tasks.pop(task))
            task.release()
    finally:
        client.cancel(list(tasks))


def _row(task: Any, trial: Trial) -> Row:
    """Return the row of an ended task."""
    error = task.exception()
    if error is None:
        row: Row = task.result()
        return row
    if type(error).__name__ == "KilledWorker":
        return failed_row(trial, "its process died, on several workers")
    raise error


def _work(trial: Trial, code: str, libraries: tuple[str, ...]) -> Row:
    """Run a trial on a worker. Raises ScenarioError if the worker has other code than the study was planned with."""
    here = (zwerm_identity(trial.point.scenario), *library_versions())
    different = [
        f"{theirs} here, {ours} there" for ours, theirs in zip((code, *libraries), here, strict=True) if ours != theirs
    ]
    if different:
        import socket

        raise ScenarioError(
            [f"--cluster: the worker on {socket.gethostname()} has other code: {each}" for each in different]
        )
    with _one_at_a_time:
        return run_trial(trial)
