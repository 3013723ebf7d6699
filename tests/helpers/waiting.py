"""Waiting for what other processes do, with a deadline."""

import time
from collections.abc import Callable
from typing import Final

DEADLINE_S: Final = 120.0


def until(holds: Callable[[], object], what: str, deadline_s: float = DEADLINE_S) -> float:
    """Return the seconds until `holds()` is true. Raises TimeoutError after `deadline_s`."""
    begin_s = time.monotonic()
    while not holds():
        if time.monotonic() > begin_s + deadline_s:
            raise TimeoutError(f"not within {deadline_s:g} s: {what}")
        time.sleep(0.01)
    return time.monotonic() - begin_s
