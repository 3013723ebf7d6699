"""The deadline of controllers that run inline: a controller that does not answer in time is interrupted, and has crashed.

In processes the world waits at the barrier and names the silent nodes. Inline the world itself would hang. An interval timer
checks twice in a deadline whether the same call of a controller still runs. Its cost is negligible. It works in the main thread
only, and not while something else uses the timer (`SIGALRM`).
"""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

from zwerm.agents.runtime import node

# A call that runs at this many successive checks, half a deadline apart, has exceeded the deadline.
CHECKS: Final = 3


class HangError(BaseException):
    """A controller runs for longer than the deadline. It is no Exception: a controller must not catch it by chance."""


@contextmanager
def hang_guard(deadline_s: float) -> Iterator[None]:
    """Raise HangError inside a controller whose answer takes longer than `deadline_s` to 1.5 times that."""
    busy = signal.getitimer(signal.ITIMER_REAL) != (0.0, 0.0) or signal.getsignal(signal.SIGALRM) != signal.SIG_DFL
    if busy or threading.current_thread() is not threading.main_thread():
        yield
        return
    seen: list[FrameType] = []

    def check(number: int, frame: FrameType | None) -> None:
        if sys.gettrace() is not None:  # a user debugs the controller
            seen.clear()
            return
        while frame is not None and not _is_answer(frame):
            frame = frame.f_back
        if seen and seen[-1] is not frame:
            seen.clear()
        if frame is not None:
            seen.append(frame)
        if len(seen) >= CHECKS:
            seen.clear()
            raise HangError(f"no answer within {deadline_s:g} s")

    signal.signal(signal.SIGALRM, check)
    signal.setitimer(signal.ITIMER_REAL, deadline_s / 2, deadline_s / 2)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)


def _is_answer(frame: FrameType) -> bool:
    return frame.f_code.co_name == "answer" and frame.f_code.co_filename == node.__file__
