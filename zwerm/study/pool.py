"""Run trials in parallel, in `jobs` worker processes with one thread each.

Rows arrive as trials end, in any order. If a worker dies (out of memory, a crash in a library), the running trials are
repeated one by one. The trial that kills its process becomes a failed row. No worker remains after the iteration ends,
is closed, or its process is killed.
"""

import os
import re
import signal
import threading
import warnings
from collections.abc import Generator, Iterator, Sequence

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.process_executor import BrokenProcessPool

from zwerm.study.trial import Row, failed_row, run_trial
from zwerm.study.trial_plan import Trial


def run_trials(trials: Sequence[Trial], jobs: int) -> Generator[Row, None, None]:
    """Yield the row of every trial. Close the iterator to stop early."""
    if jobs == 1:
        yield from map(run_trial, trials)
        return
    with warnings.catch_warnings():
        # joblib warns of unread results when it is closed early, and of workers that it replaces.
        warnings.simplefilter("ignore", UserWarning)
        try:
            with parallel_config(backend="loky", inner_max_num_threads=1):
                yield from _in_parallel(trials, jobs)
        finally:
            get_reusable_executor().shutdown(wait=True, kill_workers=True)


def _in_parallel(trials: Sequence[Trial], jobs: int) -> Iterator[Row]:
    left = list(range(len(trials)))
    while left:
        begun: list[int] = []
        done: set[int] = set()

        def feed(left: list[int] = left, begun: list[int] = begun) -> Iterator[object]:
            for index in left:
                begun.append(index)
                yield delayed(_work)(index, trials[index], os.getpid())

        try:
            for index, row in Parallel(n_jobs=jobs, batch_size=1, return_as="generator_unordered")(feed()):
                done.add(index)
                yield row
        except BrokenProcessPool:
            for index in begun:
                if index not in done:
                    done.add(index)
                    yield _alone(trials[index])
        left = [index for index in left if index not in done]


def _alone(trial: Trial) -> Row:
    """Run a trial in a pool of its own, and return its row."""
    try:
        _, row = Parallel(n_jobs=2, batch_size=1)([delayed(_work)(0, trial, os.getpid())])[0]
    except BrokenProcessPool as error:
        codes = re.search(r"exit codes of the workers are \{(.*)\}", str(error))
        return failed_row(trial, f"its process died: {codes[1] if codes else type(error).__name__}")
    result: Row = row
    return result


_watched: list[int] = []
_POLL_S = 1.0


def _work(index: int, trial: Trial, parent: int) -> tuple[int, Row]:
    """Run a trial in a worker. A worker ignores SIGINT: the parent ends its workers."""
    if not _watched:
        _watched.append(parent)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        threading.Thread(target=_exit_with_parent, args=(parent,), daemon=True).start()
    return index, run_trial(trial)


def _exit_with_parent(parent: int) -> None:
    """Exit this worker when `parent` is no longer its parent, because the parent was killed."""
    never = threading.Event()
    while os.getppid() == parent:
        never.wait(_POLL_S)
    os._exit(1)
