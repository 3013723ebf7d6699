"""A lock and a wait of the world's thread that Ctrl-C cannot leave locked.

`threading.Condition` enters and leaves its lock in Python code. A KeyboardInterrupt between the two instructions leaves it
locked for ever, and Zenoh's threads wait for it when the session closes. The lock and the queue here are written in C: an
interrupt arrives before or after each of their calls.
"""

import queue
import threading
import time
from collections.abc import Callable
from typing import Final

# The system takes no time limit of 300 years or more.
_WAIT_S_MAX: Final = threading.TIMEOUT_MAX / 2


class ArrivalSignal:
    """Guards what Zenoh's threads and the world's threads share, and wakes the latter."""

    def __init__(self) -> None:
        self.lock: Final = threading.RLock()
        self._waiting: list[queue.SimpleQueue[None]] = []

    def notify(self) -> None:
        """Let each waiting thread evaluate its condition again."""
        for wakes in tuple(self._waiting):
            wakes.put(None)

    def wait_for(self, condition: Callable[[], object], timeout_s: float) -> bool:
        """Wait until `condition()`, evaluated under the lock, is true; return whether it is within `timeout_s` seconds."""
        end_s = time.monotonic() + min(timeout_s, _WAIT_S_MAX)
        wakes: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._waiting.append(wakes)
        try:
            while True:
                with self.lock:
                    if condition():
                        return True
                try:
                    wakes.get(timeout=max(0.0, end_s - time.monotonic()))
                except queue.Empty:
                    with self.lock:
                        return bool(condition())
        finally:
            self._waiting.remove(wakes)
