"""The deadline of controllers in the world's process: one that does not answer in time is interrupted, and has crashed.

In processes the world waits at the barrier and names the silent nodes. Inline the world itself would hang, and so it would
where it imports a controller's module or makes a controller. An interval timer
checks twice in a deadline whether the same call of a controller still runs. Its cost is negligible. It works in the main thread
only, and not while something else uses the timer (`SIGALRM`).
"""

import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Final

from zwerm.agents.runtime.fork_guard import ANSWERS, MAKERS
from zwerm.errors import ControllerError

# A call that runs at this many successive checks, half a deadline apart, has exceeded the deadline.
CHECKS: Final = 3

# Time in which a controller is imported and made, as long as a robot has to join.
MADE_S_MAX: Final = 60.0


class HangError(BaseException):
    """A controller runs for longer than the deadline. It is no Exception: a controller must not catch it by chance."""


@contextmanager
def hang_guard(deadline_s: float, calls: Sequence[tuple[str, str]] = ANSWERS) -> Iterator[None]:
    """Raise HangError in a controller whose answer takes longer than `deadline_s` to 1.5 times that.

    `calls` are the functions that are guarded. A guard inside another one takes its place.
    """
    handler, timer = signal.getsignal(signal.SIGALRM), signal.getitimer(signal.ITIMER_REAL)
    busy = not isinstance(handler, _Check) and (handler != signal.SIG_DFL or timer != (0.0, 0.0))
    if busy or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGALRM, _Check(deadline_s, calls))
    signal.setitimer(signal.ITIMER_REAL, deadline_s / 2, deadline_s / 2)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
        signal.setitimer(signal.ITIMER_REAL, timer[1], timer[1])


class _Check:
    """Handles the timer's signal: raises HangError where the same call of one of `calls` runs at CHECKS checks."""

    def __init__(self, deadline_s: float, calls: Sequence[tuple[str, str]]) -> None:
        self._deadline_s = deadline_s
        self._calls = calls
        self._seen: list[FrameType] = []

    def __call__(self, number: int, frame: FrameType | None) -> None:
        seen = self._seen
        if sys.gettrace() is not None:  # a user debugs the controller
            seen.clear()
            return
        while frame is not None and (frame.f_code.co_filename, frame.f_code.co_name) not in self._calls:
            frame = frame.f_back
        if seen and seen[-1] is not frame:
            seen.clear()
        if frame is not None:
            seen.append(frame)
        if len(seen) >= CHECKS:
            seen.clear()
            raise HangError(f"no answer within {self._deadline_s:g} s")


@contextmanager
def constructors_guarded() -> Iterator[None]:
    """Raise ControllerError where a controller is imported or made in the block, and that takes longer than MADE_S_MAX."""
    try:
        with hang_guard(MADE_S_MAX, MAKERS):
            yield
    except HangError as error:
        last = traceback.extract_tb(error.__traceback__)[-2]  # the last is the check
        where = f"{last.filename}:{last.lineno}, in {last.name}"
        raise ControllerError(f"a controller was not made within {MADE_S_MAX:g} s: it runs {where}") from None
