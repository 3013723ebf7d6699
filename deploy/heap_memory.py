"""The heap of a world that runs for hours: what programs leave behind when they end goes back to the system.

A session that begins or ends allocates and frees memory in several threads. The C library keeps a heap for each thread,
and keeps what is freed. So the memory of a world grew by 50 kB for each robot that restarted (measured, 100 robots),
although no more of it was in use.
"""

import contextlib
import ctypes
from functools import cache
from typing import Final

# Heaps that all threads share; the default is eight a core.
_HEAPS: Final = 2
_M_ARENA_MAX: Final = -8


def share_heaps() -> None:
    """Let the threads that start from now on share few heaps (Linux with the GNU C library)."""
    with contextlib.suppress(OSError, AttributeError):
        _c_library().mallopt(_M_ARENA_MAX, _HEAPS)


def return_freed() -> None:
    """Return freed memory to the system (Linux with the GNU C library)."""
    with contextlib.suppress(OSError, AttributeError):
        _c_library().malloc_trim(0)


@cache
def _c_library() -> ctypes.CDLL:
    """Return the C library, opened once: each opening leaves a cycle of objects, which Python seldom looks for in a run."""
    return ctypes.CDLL(None)
