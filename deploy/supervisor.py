"""Start, watch and end the robot processes of this machine.

`stop` leaves no process and needs no cooperation of the processes. If this process is killed, the kernel kills the robots
on Linux; elsewhere they exit by themselves. This module does not depend on the scenario or the world.
"""

import atexit
import contextlib
import multiprocessing
import multiprocessing.process
import os
import resource
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any, Final

from zwerm.agents.runtime.confinement import UNCONFINED, Confinement
from zwerm.agents.runtime.process import main
from zwerm.deploy.runtime_directory import private_directory
from zwerm.errors import LinkError
from zwerm.link.peer_radio import Station
from zwerm.link.session import Credential, Credentials

# Largest number of robots that start at the same time; with more, all start later.
JOINING_MAX: Final = 16
JOIN_DEADLINE_S: Final = 60.0

# Seconds without any exit after which the remaining processes get SIGTERM, and then SIGKILL.
LEAVE_WAIT_S: Final = 3.0
TERMINATE_WAIT_S: Final = 2.0

# Open files of this process for each robot: two pipes and the router's end of the connection.
_FILES_PER_ROBOT: Final = 3
_FILES_MIN: Final = 16_384

# Bytes of the reports of robots that one read takes, and a bound of the length of a password: a report may be cut in two.
READ_BYTES: Final = 65_536
PASSWORD_BYTES_MAX: Final = 128

_INTERRUPTS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

# Places in /proc/PID/stat, after the name.
_STATE: Final = 0
_PARENT: Final = 1
_GROUP: Final = 2
_ZOMBIE: Final = "Z"

# Ids of all robots that this process has started: no other supervisor takes them for strays.
_robots: Final[set[int]] = set()
_starting: Final = threading.Lock()

# The processes that multiprocessing looks after; it has no public name.
_STARTED: Final[set[Any]] = vars(multiprocessing.process)["_children"]

Progress = Callable[[int, int], object]


def prepare(robots: int) -> None:
    """Start the forkserver, and raise the limit of open files for `robots` robots.

    Call it from the main thread, before the first Zenoh session is opened. On Linux the server ends with the thread
    that started it. A process with a session must not fork. The server runs as long as this process, and also serves
    later swarms. Raises LinkError if the limit cannot be raised far enough.
    """
    _raise_file_limit(robots * _FILES_PER_ROBOT + 200)
    _use_short_directory()
    multiprocessing.set_forkserver_preload(["zwerm.deploy.preload"])
    resource_tracker.ensure_running()
    # The server and all robots inherit the mask: only this process handles Ctrl-C, and it ends them in order.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _use_short_directory() -> None:
    """Give multiprocessing a directory for its sockets: with a short path, and removed by a later run if this one is killed."""
    config: dict[str, Any] = vars(multiprocessing.process.current_process())["_config"]
    if config.get("tempdir") is None:  # not chosen yet
        directory = contextlib.ExitStack()
        config["tempdir"] = str(directory.enter_context(private_directory()))
        # Runs after the end functions of multiprocessing, which are registered later.
        atexit.register(directory.close)


def _raise_file_limit(needed: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = max(needed, _FILES_MIN)  # the server inherits the limit, and may serve a larger swarm later
    if hard != resource.RLIM_INFINITY:
        if hard < needed:
            raise LinkError(f"the robots need {needed} open files, the limit is {hard} (ulimit -n)")
        wanted = min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


class LocalSupervisor:
    """One process for each of `credentials`, connected to `endpoint`; `order` is the order of starting.

    Nodes in `stations` send packets over a real network.
    """

    def __init__(
        self,
        endpoint: str,
        credentials: Credentials,
        *,
        order: Sequence[int] | None = None,
        stations: Mapping[int, Station] | None = None,
        confinement: Confinement = UNCONFINED,
    ) -> None:
        """Raises LinkError where this machine cannot confine robots so."""
        confinement.check()
        self._confinement = confinement
        self._endpoint = endpoint
        self._run = credentials.run
        self._terms = credentials.terms
        self._credentials = {credential.node: credential for credential in credentials.nodes}
        self._order = list(self._credentials) if order is None else list(order)
        self._context = multiprocessing.get_context("forkserver")
        self._stations = stations or {}
        self._processes: dict[int, ForkServerProcess] = {}

    def __enter__(self) -> "LocalSupervisor":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def pids(self) -> dict[int, int]:
        """The process id of every robot started."""
        return {node: process.pid for node, process in self._processes.items() if process.pid is not None}

    @property
    def exit_codes(self) -> dict[int, int]:
        """The exit code of every robot that has ended; -9 for one ended by signal 9."""
        codes = {node: process.exitcode for node, process in self._processes.items()}
        return {node: code for node, code in codes.items() if code is not None}

    def start(self, progress: Progress | None = None, deadline_s: float = JOIN_DEADLINE_S) -> None:
        """Start all robots, and return when all have joined.

        Calls `progress` with the number of joined robots and the number of all. Raises LinkError if a robot ends before
        it joins, or does not join within `deadline_s` of its own start.
        """
        credentials = [self._credentials[node] for node in self._order]
        for number, _ in enumerate(self._launch(credentials, deadline_s), 1):
            if progress is not None:
                progress(number, len(credentials))

    def restart(self, credential: Credential, deadline_s: float = JOIN_DEADLINE_S) -> None:
        """Start an ended robot again, as the incarnation in `credential`. Raises LinkError as `start` does."""
        for _ in self._launch([credential], deadline_s):
            pass

    def kill(self, node: int) -> None:
        """Kill one robot and wait until its process has ended."""
        process = self._processes[node]
        process.kill()
        process.join()
        self._end_children([process])

    def end_of(self, node: int, wait_s: float) -> str:
        """Return how a robot's process ended, waiting at most `wait_s` for it: its signal or exit code; "" while it runs."""
        process = self._processes[node]
        process.join(wait_s)
        code = process.exitcode
        if code is None:
            return ""
        if code < 0:
            return f"its process was ended by signal {-code} ({signal.Signals(-code).name})"
        return f"its process ended with exit code {code}"

    def send_signal(self, node: int, number: signal.Signals) -> None:
        """Send a signal to one robot, such as SIGSTOP and SIGCONT."""
        os.kill(self.pids[node], number)

    def wait(self, wait_s: float | None = None) -> bool:
        """Wait until all robots have ended, or none ends for `patience_s` seconds. Return whether all have ended."""
        alive: dict[Any, ForkServerProcess] = {process.sentinel: process for process in self._alive()}
        while alive:
            ended = wait(list(alive), wait_s)
            if not ended:
                return False
            for sentinel in ended:
                alive.pop(sentinel).join()
        return True

    def stop(self, wait_s: float = 0.0) -> None:
        """End all robots: wait as `wait` does, then send SIGTERM, then SIGKILL. Idempotent."""
        with interrupts_held():
            if not self.wait(wait_s):
                for process in self._alive():
                    process.terminate()
                if not self.wait(TERMINATE_WAIT_S):
                    for process in self._alive():
                        process.kill()
                    # Their end is reported by the server, and the end of this program waits for it.
                    if not self.wait(LEAVE_WAIT_S):
                        _kill_server()
                        self.wait(LEAVE_WAIT_S)
            self._end_children(list(self._processes.values()))

    def _end_children(self, ended: Sequence[ForkServerProcess]) -> None:
        """Kill what the controllers of robots that have `ended` started.

        Each robot is the leader of a process group. What has left the group becomes a child of the robots' server when its
        parent has ended.
        """
        server = _server_pid()
        with _starting:
            found = dict(_running_processes())
            robots = frozenset(_robots)
        groups = {process.pid for process in ended}
        own_group = found[server][1] if server in found else None
        strays = {pid for pid, (_, group) in found.items() if group in groups and pid != group}
        strays |= {
            pid
            for pid, (parent, group) in found.items()
            if parent == server and pid not in robots and group != own_group
        }
        started = [pid for pid in found if _descends(pid, strays, found)]
        for pid in started:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def _alive(self) -> list[ForkServerProcess]:
        return [process for process in self._processes.values() if process.exitcode is None]

    def _launch(self, credentials: Sequence[Credential], deadline_s: float) -> Iterator[int]:
        """Start a process for each of `credentials`, and yield each node's id once it has joined.

        A robot reports with its password, because its controller could write to the same pipe: it cannot report for others.
        """
        waiting = deque(credentials)
        missing: dict[int, tuple[ForkServerProcess, float]] = {}
        reports = b""
        reader, writer = self._context.Pipe(duplex=False)
        with reader, writer:
            while waiting or missing:
                with interrupts_held(), main_module_hidden(), server_answers(deadline_s):
                    while waiting and len(missing) < JOINING_MAX:
                        credential = waiting.popleft()
                        process = self._start_process(credential, deadline_s, writer)
                        missing[credential.node] = process, time.monotonic() + deadline_s
                first, end_s = next(iter(missing.values()))
                sentinels = [process.sentinel for process, _ in missing.values()]
                ready = wait([reader, *sentinels], max(0.0, end_s - time.monotonic()))
                if reader in ready:  # before the sentinels: a joined robot may have ended since
                    reports += os.read(reader.fileno(), READ_BYTES)
                    for node in [node for node in missing if self._credentials[node].password.encode() in reports]:
                        del missing[node]
                        yield node
                    reports = reports[-PASSWORD_BYTES_MAX:]
                    continue
                for process, _ in missing.values():
                    if process.sentinel in ready:
                        process.join()
                        raise LinkError(f"{process.name} ended with exit code {process.exitcode} before it joined")
                raise LinkError(f"{first.name} did not join within {deadline_s:g} s")

    def _start_process(self, credential: Credential, deadline_s: float, joined: Connection) -> ForkServerProcess:
        process = self._context.Process(
            target=main,
            args=(
                *(self._run, credential, self._endpoint, self._terms, deadline_s, joined),
                self._stations.get(credential.node),
                self._confinement,
            ),
            name=f"node {credential.node}",
            daemon=True,
        )
        with _starting:
            process.start()
            _robots.update([] if process.pid is None else [process.pid])
            # multiprocessing asks each process that it has started whether it has ended, whenever it starts another one: 2 s of
            # processor time while 1,000 robots start. This class ends its robots itself.
            _STARTED.discard(process)
        self._processes[credential.node] = process
        return process


@contextlib.contextmanager
def interrupts_held() -> Iterator[None]:
    """Defer the signals that interrupt this program, and that it handles, to the end of the block."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    before = {number: signal.getsignal(number) for number in _INTERRUPTS if callable(signal.getsignal(number))}
    for number in before:
        signal.signal(number, lambda number, frame: held.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if held:
            signal.raise_signal(held[0])


@contextlib.contextmanager
def server_answers(deadline_s: float) -> Iterator[None]:
    """Raise LinkError if the server that robots are forked from ends in the block, or does not answer in `deadline_s`.

    Starting a process waits for its answer without a limit. So a server that hangs or is stopped is killed after that time; its
    robots end with it, and `prepare` starts another one.
    """
    timer = threading.Timer(deadline_s, _kill_server)
    timer.daemon = True
    timer.start()
    try:
        yield
    except (EOFError, ConnectionError) as error:
        raise LinkError(f"the server that robots are forked from has ended or does not answer: {error}") from None
    finally:
        timer.cancel()


def _server_pid() -> int | None:
    server: int | None = vars(forkserver)["_forkserver"]._forkserver_pid  # it has no public name
    return server


def _running_processes() -> Iterator[tuple[int, tuple[int, int]]]:
    """Yield the id of each process that runs, with its parent and its group (Linux only)."""
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError):  # it has ended
            fields = entry.read_text().rpartition(")")[2].split()
            if fields[_STATE] != _ZOMBIE:
                yield int(entry.parent.name), (int(fields[_PARENT]), int(fields[_GROUP]))


def _descends(pid: int, ancestors: Collection[int], found: Mapping[int, tuple[int, int]]) -> bool:
    """Return whether a process is one of `ancestors`, or was started by one."""
    while pid in found:
        if pid in ancestors:
            return True
        pid = found[pid][0]
    return False


def _kill_server() -> None:
    server = _server_pid()
    if server is not None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(server, signal.SIGKILL)


@contextlib.contextmanager
def main_module_hidden() -> Iterator[None]:
    """Prevent robot processes from importing the main module of this process, and its imports."""
    module = sys.modules["__main__"]
    names: dict[str, Any] = vars(module)
    hidden: dict[str, Any] = {name: names[name] for name in ("__spec__", "__file__") if name in names}
    names.update(dict.fromkeys(hidden))
    try:
        yield
    finally:
        names.update(hidden)
