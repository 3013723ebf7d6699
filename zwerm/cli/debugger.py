"""`breakpoint()` in a controller of an inline run: the progress display stops, and `q` ends the run as Ctrl-C does.

A debugger that PYTHONBREAKPOINT names is used as it is.
"""

import os
import pdb
import sys
from bdb import BdbQuit
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class _Debugger(pdb.Pdb):
    """A debugger that ends the run if the user quits. An error of a controller would let the run go on without its
    node."""

    def trace_dispatch(self, frame: FrameType, event: str, arg: Any) -> Any:
        """Trace as Pdb does. Raises KeyboardInterrupt if the user quits."""
        try:
            return super().trace_dispatch(frame, event, arg)
        except BdbQuit:
            sys.settrace(None)
            raise KeyboardInterrupt from None


@contextmanager
def breakpoints(before: Callable[[], object]) -> Iterator[None]:
    """Within this context `breakpoint()` calls `before`, and then opens the debugger at the line after itself."""
    known = sys.breakpointhook
    if os.environ.get("PYTHONBREAKPOINT"):
        yield
        return

    def hook(*_: object, **__: object) -> None:
        before()
        _Debugger().set_trace(sys._getframe(1))

    sys.breakpointhook = hook
    try:
        yield
    finally:
        sys.breakpointhook = known
