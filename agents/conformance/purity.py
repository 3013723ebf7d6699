"""Detect forbidden actions of a controller: read a clock, draw from a global random stream, use files, network or processes.

A `PurityMonitor` records the violations of the code that runs inside it, in its own thread, and does not stop the code. It
detects calls of functions written in C, the interpreter's audit events (PEP 578), changes of the global random streams, and
printed text. The way a function was imported makes no difference. Imports are allowed. It does not see system calls that C
code makes without an audit event: it detects mistakes, and is no sandbox.
"""

import contextlib
import datetime
import gc
import importlib
import io
import os
import random
import sys
import sysconfig
import threading
from types import FrameType, TracebackType
from typing import Any, Final, Self

# Functions written in C: description of the violation -> module -> names.
_FORBIDDEN: Final = {
    "reads the wall clock": {
        "time": "time time_ns monotonic monotonic_ns perf_counter perf_counter_ns process_time process_time_ns"
        " thread_time thread_time_ns clock_gettime clock_gettime_ns localtime ctime",
        "os": "times",
    },
    "sleeps": {"time": "sleep"},
    "draws from the operating system's entropy": {"os": "urandom getrandom"},
    "asks which process it is": {"os": "getpid getppid"},
    "starts a thread": {"_thread": "start_new_thread start_joinable_thread"},
}
_NOW: Final = ("now", "today", "utcnow")

# Audited events, by the beginning of their names.
_AUDITED: Final = {
    "open": "opens a file",
    "socket.": "uses the network",
    "subprocess.": "starts a process",
    "os.system": "starts a process",
    "os.fork": "starts a process",
    "os.exec": "starts a process",
    "os.posix_spawn": "starts a process",
    "os.spawn": "starts a process",
    "os.kill": "sends a signal",
    "os.": "touches the file system or the environment",
    "shutil.": "touches the file system or the environment",
    "glob.": "touches the file system or the environment",
    "builtins.input": "reads the terminal",
    "sqlite3.": "opens a database",
}
_STREAMS: Final = {"random": ("getstate", "setstate"), "numpy.random": ("get_state", "set_state")}

_STANDARD_LIBRARY: Final = (sysconfig.get_path("stdlib"), sysconfig.get_path("platstdlib"))


def _forbidden_functions() -> dict[Any, str]:
    found = {}
    for what, modules in _FORBIDDEN.items():
        for name, functions in modules.items():
            module = importlib.import_module(name)
            for function in functions.split():
                if hasattr(module, function):
                    found[getattr(module, function)] = f"{what}: {name}.{function}()"
    return found


class PurityMonitor:
    """Context manager that watches the code inside it. `found` lists each violation once, with its file and line."""

    def __init__(self) -> None:
        self.found: list[str] = []
        self._functions = _forbidden_functions()
        self._global_random: Any = getattr(random, "_inst")  # noqa: B009 - typeshed hides it
        self._read_environment = type(os.environ).__getitem__.__code__
        self._printed = io.StringIO()
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> Self:
        _audit()
        self._states = _stream_states()
        self._stack.enter_context(contextlib.redirect_stdout(self._printed))
        self._stack.enter_context(contextlib.redirect_stderr(self._printed))
        self._profiler = sys.getprofile()
        _active[threading.get_ident()] = self
        # Callbacks of the garbage collector are not the controller's, so the collector is off.
        self._collecting = gc.isenabled()
        gc.disable()
        sys.setprofile(self._called)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        sys.setprofile(self._profiler)
        if self._collecting:
            gc.enable()
        del _active[threading.get_ident()]
        self._stack.close()
        printed = self._printed.getvalue().strip()
        if printed:
            self._record(f"prints: {printed.splitlines()[0][:60]!r}", None)
        for name, state in _stream_states().items():
            if _plain(state) != _plain(self._states[name]):
                what = f"draws from a global random stream: {name}"
                if not any(each.startswith(f"{what},") for each in self.found):
                    self._record(what, None)
                getattr(importlib.import_module(name), _STREAMS[name][1])(self._states[name])

    def _called(self, frame: FrameType, event: str, argument: Any) -> None:
        """Check a call; this is the interpreter's profiling hook."""
        if event == "c_call":
            owner = getattr(argument, "__self__", None)
            if owner is self._global_random:
                self._record("draws from a global random stream: random", frame)
            elif isinstance(owner, type) and argument.__name__ in _NOW and issubclass(owner, datetime.date):
                self._record(f"reads the wall clock: {owner.__name__}.{argument.__name__}()", frame)
            elif argument in self._functions and not _is_numpy_seeding(frame):
                self._record(self._functions[argument], frame)
        elif event == "call" and frame.f_code is self._read_environment:
            self._record("reads the environment: os.environ", frame)

    def audited(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Check an audit event of the interpreter."""
        what = next((text for start, text in _AUDITED.items() if event.startswith(start)), None)
        if what is not None:
            detail = f": {arguments[0]!r}" if event == "open" else f" ({event})"
            self._record(what + detail, sys._getframe())

    def _record(self, what: str, frame: FrameType | None) -> None:
        if _is_importing(frame):
            return
        line = what + _place(frame)
        if line not in self.found:
            self.found.append(line)


def _stream_states() -> dict[str, Any]:
    return {name: getattr(importlib.import_module(name), get)() for name, (get, _) in _STREAMS.items()}


def _plain(state: Any) -> Any:
    """Return the state of a random stream in a comparable form: arrays as bytes."""
    return tuple(map(_plain, state)) if isinstance(state, tuple) else getattr(state, "tobytes", lambda: state)()


_active: dict[int, PurityMonitor] = {}
_audited = threading.Event()


def _audit() -> None:
    """Install the audit hook once. Python cannot remove it; it does nothing while no monitor is active."""
    if not _audited.is_set():
        _audited.set()
        sys.addaudithook(_hook)


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    if _active and (monitor := _active.get(threading.get_ident())) is not None:
        monitor.audited(event, arguments)


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _is_numpy_seeding(frame: FrameType) -> bool:
    """Return whether this call may be numpy, which asks for entropy even if it gets a key and does not use the entropy.

    If it uses the entropy, the controller's answers differ between runs, and the kit detects this.
    """
    return frame.f_code.co_name == "getrandbits" and frame.f_code.co_filename.startswith(_STANDARD_LIBRARY)


def _place(frame: FrameType | None) -> str:
    """Return ` at file:line` of the nearest frame outside the standard library and this file."""
    while frame is not None:
        file = frame.f_code.co_filename
        is_library = file.startswith((*_STANDARD_LIBRARY, "<frozen")) and "site-packages" not in file
        if file != __file__ and not is_library:
            return f", at {file}:{frame.f_lineno}"
        frame = frame.f_back
    return ""
