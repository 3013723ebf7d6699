"""Robot processes of this machine: started in waves, watched, and ended, whatever happens.

Promises: `stop` leaves no process, and needs no cooperation of theirs; if this process is killed the kernel ends them
(on Linux; elsewhere they end themselves). Knows nothing of the run they take part in.
"""

import contextlib
import multiprocessing
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess
from typing import Any, Final, cast

from zwerm.agents.robot import main
from zwerm.errors import LinkError
from zwerm.link.session import Credential, Credentials

WAVE: Final = 16
JOIN_DEADLINE_S: Final = 60.0
LEAVE_DEADLINE_S: Final = 5.0
TERMINATE_DEADLINE_S: Final = 2.0

# Open files a robot costs this process: two pipes and the router's end of its connection.
_FILES_PER_ROBOT: Final = 3
_FILES_MIN: Final = 16_384

Progress = Callable[[int, int], object]


def prepare(robots: int) -> None:
    """Start the server that robots are forked from, and raise the limit of open files for `robots` of them.

    Call it from the main thread, and before the first Zenoh session is opened: on Linux the server ends with the thread
    that started it, and no fork may come after a session. The server lives as long as this process, and serves every
    later swarm too. Raises LinkError where the limit cannot be raised far enough.
    """
    _raise_file_limit(robots * _FILES_PER_ROBOT + 200)
    multiprocessing.set_forkserver_preload(["zwerm.deploy.nursery"])
    resource_tracker.ensure_running()
    # The server and every robot inherit the mask: Ctrl-C is for this process, which then ends them in order.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _raise_file_limit(needed: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = max(needed, _FILES_MIN)  # the server inherits the limit, and may have to serve a larger swarm later
    if hard != resource.RLIM_INFINITY:
        if hard < needed:
            raise LinkError(f"the robots need {needed} open files, the limit is {hard} (ulimit -n)")
        wanted = min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


class LocalSupervisor:
    """One process for each of `credentials`, connected to `endpoint`; `order` is the order of starting."""

    def __init__(
        self, endpoint: str, credentials: Credentials, *, order: Sequence[int] | None = None, wave: int = WAVE
    ) -> None:
        self._endpoint = endpoint
        self._run = credentials.run
        self._authority_pem = credentials.authority_pem
        self._credentials = {credential.node: credential for credential in credentials.nodes}
        self._order = list(self._credentials) if order is None else list(order)
        self._wave = wave
        self._context = multiprocessing.get_context("forkserver")
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
        """Start all robots, a wave at a time, each wave once the one before has joined.

        `progress` is called with how many have joined, and of how many. Raises LinkError where a robot ends before it
        has joined, or a wave has not joined within `deadline_s`.
        """
        total = len(self._order)
        for first in range(0, total, self._wave):
            wave = [self._credentials[node] for node in self._order[first : first + self._wave]]
            for number, _ in enumerate(self._launch(wave, deadline_s), first + 1):
                if progress is not None:
                    progress(number, total)

    def restart(self, credential: Credential, deadline_s: float = JOIN_DEADLINE_S) -> None:
        """Start a robot that has ended once more, under the incarnation in `credential`. Raises as `start`."""
        for _ in self._launch([credential], deadline_s):
            pass

    def kill(self, node: int) -> None:
        """Kill one robot and wait until it is gone."""
        process = self._processes[node]
        process.kill()
        process.join()

    def send_signal(self, node: int, number: signal.Signals) -> None:
        """Send a signal to one robot, such as SIGSTOP and SIGCONT."""
        os.kill(self.pids[node], number)

    def wait(self, deadline_s: float | None = None) -> bool:
        """Wait until all robots have ended, at most `deadline_s` seconds; tell whether they have."""
        end_s = None if deadline_s is None else time.monotonic() + deadline_s
        alive: dict[Any, ForkServerProcess] = {process.sentinel: process for process in self._alive()}
        while alive:
            ended = wait(list(alive), None if end_s is None else max(0.0, end_s - time.monotonic()))
            if not ended:
                return False
            for sentinel in ended:
                alive.pop(sentinel).join()
        return True

    def stop(self, leave_deadline_s: float = 0.0) -> None:
        """End all robots: let them leave by themselves for so long, then SIGTERM, then SIGKILL; idempotent."""
        with interrupts_held():
            if self.wait(leave_deadline_s):
                return
            for process in self._alive():
                process.terminate()
            if self.wait(TERMINATE_DEADLINE_S):
                return
            for process in self._alive():
                process.kill()
            self.wait(LEAVE_DEADLINE_S)

    def _alive(self) -> list[ForkServerProcess]:
        return [process for process in self._processes.values() if process.exitcode is None]

    def _launch(self, credentials: Sequence[Credential], deadline_s: float) -> Iterator[int]:
        """Start a process for each of `credentials`, and yield each node's id once it has joined."""
        end_s = time.monotonic() + deadline_s
        reader, writer = self._context.Pipe(duplex=False)
        with reader:
            with writer, interrupts_held(), _main_module_hidden():
                for credential in credentials:
                    self._processes[credential.node] = self._started(credential, deadline_s, writer)
            missing = {credential.node: self._processes[credential.node] for credential in credentials}
            while missing:
                sentinels = {process.sentinel: node for node, process in missing.items()}
                ready = wait([reader, *sentinels], max(0.0, end_s - time.monotonic()))
                if reader in ready and (node := _received(reader)) is not None:
                    del missing[node]
                    yield node
                    continue
                # What a robot wrote before it ended has been read, or there is nobody left to write.
                for sentinel in wait(list(sentinels), 1.0) if ready else []:
                    process = missing[sentinels[cast(int, sentinel)]]
                    process.join()
                    raise LinkError(f"{process.name} ended with exit code {process.exitcode} before it joined")
                raise LinkError(f"{next(iter(missing.values())).name} did not join within {deadline_s:g} s")

    def _started(self, credential: Credential, deadline_s: float, joined: Connection) -> ForkServerProcess:
        process = self._context.Process(
            target=main,
            args=(self._run, credential, self._endpoint, self._authority_pem, deadline_s, joined),
            name=f"node {credential.node}",
            daemon=True,
        )
        process.start()
        return process


def _received(reader: Connection) -> int | None:
    """Return the id of a node that has joined, or None where no robot is left that could write one."""
    try:
        return int(reader.recv_bytes())
    except EOFError:
        return None


@contextlib.contextmanager
def interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back until the block has ended, and deliver it then."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: held.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if held:
            signal.raise_signal(signal.SIGINT)


@contextlib.contextmanager
def _main_module_hidden() -> Iterator[None]:
    """Keep robot processes from importing the program that starts them, and all that it imports."""
    module = sys.modules["__main__"]
    names: dict[str, Any] = vars(module)
    hidden: dict[str, Any] = {name: names[name] for name in ("__spec__", "__file__") if name in names}
    names.update(dict.fromkeys(hidden))
    try:
        yield
    finally:
        names.update(hidden)
