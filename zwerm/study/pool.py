"""Run trials in parallel, in `jobs` worker processes with one thread each.

Rows arrive as trials end, in any order. If a worker dies (out of memory, a crash in a library), the running trials are
repeated one by one. The trial that kills its process becomes a failed row. No worker remains after the iteration ends,
is closed, or its process is killed.
"""

import faulthandler
import os
import re
import signal
import threading
import warnings
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import Final

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.process_executor import BrokenProcessPool

from zwerm.study.trial import Row, failed_row, run_trial
from zwerm.study.trial_plan import Trial


def run_trials(trials: Sequence[Trial], jobs: int, timeout_s: float | None = None) -> Generator[Row, None, None]:
    """Yield the row of every trial. Close the iterator to stop early.

    A trial without a result after `timeout_s` is ended and becomes a failed row. With one job trials run in this
    process, where nothing ends them.
    """
    if jobs == 1:
        yield from map(run_trial, trials)
        return
    with warnings.catch_warnings():
        # joblib warns of unread results if it is closed early, and of workers that it replaces.
        warnings.simplefilter("ignore", UserWarning)
        try:
            with parallel_config(backend="loky", inner_max_num_threads=1):
                yield from _in_parallel(trials, jobs, timeout_s)
        finally:
            get_reusable_executor().shutdown(wait=True, kill_workers=True)


def _in_parallel(trials: Sequence[Trial], jobs: int, timeout_s: float | None) -> Iterator[Row]:
    left = list(range(len(trials)))
    while left:
        begun: list[int] = []
        done: set[int] = set()

        def feed(left: list[int] = left, begun: list[int] = begun) -> Iterator[object]:
            for index in left:
                begun.append(index)
                yield delayed(_work)(index, trials[index], os.getpid(), timeout_s)

        try:
            for index, row in Parallel(n_jobs=jobs, batch_size=1, return_as="generator_unordered")(feed()):
                done.add(index)
                yield row
        except BrokenProcessPool:
            for index in begun:
                if index not in done:
                    done.add(index)
                    yield _alone(trials[index], timeout_s)
        left = [index for index in left if index not in done]


_ENDED_BY_TIMER: Final = "EXIT(1)"  # how joblib names the end by `dump_traceback_later`


def _alone(trial: Trial, timeout_s: float | None) -> Row:
    """Run a trial in a pool of its own, and return its row."""
    try:
        _, row = Parallel(n_jobs=2, batch_size=1)([delayed(_work)(0, trial, os.getpid(), timeout_s)])[0]
    except BrokenProcessPool as error:
        codes = re.search(r"exit codes of the workers are \{(.*)\}", str(error))
        if timeout_s is not None and codes is not None and _ENDED_BY_TIMER in codes[1]:
            return failed_row(trial, f"it had no result within {timeout_s:g} s")
        return failed_row(trial, f"its process died: {codes[1] if codes else type(error).__name__}")
    result: Row = row
    return result


_watched: list[int] = []
_POLL_S = 1.0


def _work(index: int, trial: Trial, parent: int, timeout_s: float | None) -> tuple[int, Row]:
    """Run a trial in a worker. A worker ignores SIGINT: the parent ends its workers."""
    if not _watched:
        _watched.append(parent)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        threading.Thread(target=_exit_with_parent, args=(parent,), daemon=True).start()
    if timeout_s is None:
        return index, run_trial(trial)
    # Ends this process from a separate thread, independent of the trial's state.
    with Path(os.devnull).open("w") as nowhere:
        faulthandler.dump_traceback_later(timeout_s, exit=True, file=nowhere)
        try:
            return index, run_trial(trial)
        finally:
            faulthandler.cancel_dump_traceback_later()


def _exit_with_parent(parent: int) -> None:
    """Exit this worker when `parent` is no longer its parent, because the parent was killed."""
    never = threading.Event()
    while os.getppid() == parent:
        never.wait(_POLL_S)
    os._exit(1)
