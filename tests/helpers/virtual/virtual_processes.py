"""A simulated operating system for the supervisor: processes, their deaths, and a clock, all in virtual time.

The supervisor is the real one, and so is the pipe by which robots report. Processes and time are replaced. Each robot has a
`Fate`: when it joins, ends or writes junk, and how it takes signals.
"""

import contextlib
import heapq
import itertools
import os
import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as real_wait
from typing import Any

import pytest

from zwerm.deploy import supervisor
from zwerm.link.session import Credential

NEVER = float("inf")

# No process of a real system has such an id.
FIRST_PID = 1 << 40


@dataclass(frozen=True)
class Fate:
    """What a robot does, in seconds after its start; `ends_s` counts from joining where it joins first.

    `junk` is written to the pipe at the start. After SIGTERM the robot takes `leaves_s` to end.
    """

    joins_s: float = NEVER
    ends_s: float = NEVER
    exit_code: int = 1
    junk: bytes = b""
    leaves_s: float = 0.1


class VirtualProcess:
    """One process, with the part of the interface of `multiprocessing.Process` that the supervisor uses."""

    def __init__(self, system: "VirtualSystem", args: Sequence[Any], name: str) -> None:
        _, self._credential, _, _, _, self._joined, *_ = args
        self._system = system
        self.node: int = self._credential.node
        self.name = name
        self.pid: int | None = None
        self.exitcode: int | None = None
        self.sentinel = self
        self.has_joined = False

    def start(self) -> None:
        """Start: from now on its fate happens."""
        system = self._system
        self.pid = next(system.pids)
        system.started.append(self)
        fate = system.fate_of(self._credential)
        system.starting_max = max(system.starting_max, sum(not each.has_joined for each in system.living()))
        self._fate, self._joined = fate, os.dup(self._joined.fileno())
        if fate.junk:
            os.write(self._joined, fate.junk)
        if fate.joins_s < fate.ends_s:
            system.at(system.now + fate.joins_s, self._join)
        elif fate.ends_s < NEVER:
            system.at(system.now + fate.ends_s, partial(self._end, fate.exit_code))

    def _join(self) -> None:
        if self.exitcode is None:
            self.has_joined = True
            with contextlib.suppress(OSError):  # the supervisor does not wait any more
                os.write(self._joined, self._credential.password.encode())
            if self._fate.ends_s < NEVER:
                self._system.at(self._system.now + self._fate.ends_s, partial(self._end, self._fate.exit_code))

    def _end(self, code: int) -> None:
        if self.exitcode is None and self.pid is not None:
            self.exitcode = code
            os.close(self._joined)

    def kill(self) -> None:
        """Take SIGKILL: nothing withstands it."""
        self._end(-signal.SIGKILL)

    def terminate(self) -> None:
        """Take SIGTERM: the robot leaves after its time, or never."""
        if self._fate.leaves_s < NEVER:
            self._system.at(self._system.now + self._fate.leaves_s, partial(self._end, 0))

    def join(self, timeout_s: float | None = None) -> None:
        """Wait for the end."""
        self._system.wait([self], timeout_s)


class VirtualSystem:
    """The processes and the clock. `fate_of` decides on each robot when it starts."""

    def __init__(self, fate_of: Callable[[Credential], Fate], monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        self.fate_of = fate_of
        self.started: list[VirtualProcess] = []
        self.starting_max = 0
        self.pids = itertools.count(FIRST_PID)
        self.interrupt_at_s = NEVER
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._number = itertools.count()
        monkeypatch.setattr(supervisor, "wait", self.wait)
        monkeypatch.setattr(supervisor, "time", self)
        # What controllers start is searched among the processes of the real system.
        monkeypatch.setattr(supervisor.LocalSupervisor, "_end_children", lambda own, ended: None)

    def Process(self, target: Any, args: Sequence[Any], name: str, daemon: bool) -> VirtualProcess:
        """Return a process, as a context of `multiprocessing` does."""
        return VirtualProcess(self, args, name)

    def Pipe(self, duplex: bool) -> tuple[Connection, Connection]:
        """Return a real pipe."""
        reader, writer = os.pipe()
        return Connection(reader, writable=False), Connection(writer, readable=False)

    def monotonic(self) -> float:
        """Return the virtual time [s]."""
        return self.now

    def at(self, time_s: float, happen: Callable[[], None]) -> None:
        """Let something happen at a time."""
        heapq.heappush(self._events, (time_s, next(self._number), happen))

    def living(self) -> list[VirtualProcess]:
        """Return the processes that run."""
        return [process for process in self.started if process.exitcode is None]

    def wait(self, things: Sequence[Any], timeout_s: float | None = None) -> list[Any]:
        """Return those of `things` that are ready, once one is, or [] after `timeout_s`.

        Sends SIGINT to this process at `interrupt_at_s`.
        """
        end_s = NEVER if timeout_s is None else self.now + timeout_s
        while not (ready := self._ready(things)):
            next_s = self._events[0][0] if self._events else NEVER
            until_s = min(next_s, end_s, max(self.interrupt_at_s, self.now))
            assert until_s < NEVER, "the supervisor waits for ever"
            self.now = max(self.now, until_s)
            if self.now >= self.interrupt_at_s:
                self.interrupt_at_s = NEVER
                signal.raise_signal(signal.SIGINT)
            if next_s <= end_s:
                self._pop()
            elif self.now >= end_s:
                return []
        return ready

    def _pop(self) -> None:
        """Let the next event happen."""
        heapq.heappop(self._events)[2]()

    def _ready(self, things: Sequence[Any]) -> list[Any]:
        pipes = [each for each in things if isinstance(each, Connection)]
        ended = [each for each in things if isinstance(each, VirtualProcess) and each.exitcode is not None]
        return [*real_wait(pipes, 0), *ended] if pipes else ended
