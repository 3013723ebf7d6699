"""Waiting for what other processes do, with a deadline."""

import time
from collections.abc import Callable
from typing import Final

DEADLINE_S: Final = 120.0


def until(holds: Callable[[], object], what: str) -> float:
    """Return the seconds until `holds()` is true. Raises TimeoutError after DEADLINE_S."""
    begin_s = time.monotonic()
    while not holds():
        if time.monotonic() > begin_s + DEADLINE_S:
            raise TimeoutError(f"not within {DEADLINE_S:g} s: {what}")
        time.sleep(0.01)
    return time.monotonic() - begin_s
