"""Hosts with robots in virtual time, one or several at once: `run_robots`, the supervisor and the admission of nodes are the
real ones. Everything that happens is a function of the seed."""

import random
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from virtual_network import LEASE_S
from virtual_processes import NEVER, Fate, VirtualProcess, VirtualSystem

from zwerm.agents.runtime.process import EXIT_LOST, EXIT_REFUSED
from zwerm.deploy import remote
from zwerm.deploy.identity import issue, save, slice_of
from zwerm.errors import LinkError
from zwerm.link.admission import Admission, ExpectedNode
from zwerm.link.session import Credential
from zwerm.wire.messages import Hello

DEADLINE_S = 60.0
LATENCY_S = 2.0


class VirtualWorld:
    """A world that listens from `opens_s` to `closes_s`. The nodes `own` cannot reach it from `cut_s` to `mended_s`."""

    def __init__(self, seed: int, folder: Path, monkeypatch: pytest.MonkeyPatch, system: type[VirtualSystem]) -> None:
        self.draw = random.Random(seed)
        self.system = system(self._start, monkeypatch)
        monkeypatch.setattr(remote, "prepare", lambda robots: None)
        monkeypatch.setattr(remote, "time", self.system)
        monkeypatch.setattr("zwerm.deploy.supervisor.multiprocessing.get_context", lambda kind: self.system)
        self.credentials = issue("run", range(self.draw.randint(2, 50)))
        nodes = [each.node for each in self.credentials.nodes]
        self.own = sorted(self.draw.sample(nodes, self.draw.randint(1, len(nodes))))
        self.admission = Admission({node: ExpectedNode(1, "", b"") for node in nodes})
        self.opens_s, self.closes_s, self.cut_s, self.mended_s = 0.0, NEVER, NEVER, NEVER
        self._folder = folder / f"{seed}-{len(list(folder.iterdir()))}"
        self._folder.mkdir()

    def run_host(self, nodes: Sequence[int] = ()) -> dict[int, int]:
        """Run some robots, or those of `own`, as `zwerm robot` does on one host."""
        chosen = list(nodes or self.own)
        keys = self._folder / ("-".join(map(str, chosen[:3])) + f"-{len(list(self._folder.iterdir()))}.key")
        save(slice_of(self.credentials, chosen), keys)
        return remote.run_robots("tcp/127.0.0.1:1", keys, deadline_s=DEADLINE_S)

    def attempt(self, nodes: Sequence[int] = ()) -> tuple[dict[int, int], str]:
        """Run robots, and return their exit codes, or why they did not join."""
        try:
            return self.run_host(nodes), ""
        except LinkError as error:
            return {}, str(error)

    def _start(self, credential: Credential) -> Fate:
        """Let a robot join as soon as the world can be reached, be refused by it, or give up after its deadline."""
        system = self.system
        reached_s = max(system.now, self.opens_s) + self.draw.uniform(0.1, LATENCY_S)
        if credential.node in self.own and self.cut_s < reached_s < self.mended_s:
            reached_s = self.mended_s + self.draw.uniform(0.1, LATENCY_S)
        if reached_s > system.now + DEADLINE_S:
            return Fate(ends_s=DEADLINE_S, exit_code=EXIT_REFUSED)
        process = system.started[-1]
        system.at(reached_s, lambda: self._greet(process, credential))
        return Fate()

    def _greet(self, process: VirtualProcess, credential: Credential) -> None:
        if process.exitcode is not None:
            return
        if self.admission.greet(credential.node, Hello(credential.node, credential.incarnation)):
            process._end(EXIT_REFUSED)
            return
        process._join()
        lost_s = max(self.cut_s, self.system.now) + LEASE_S
        if credential.node in self.own and self.cut_s < NEVER and self.mended_s > lost_s:
            self.system.at(lost_s, lambda: self._lose(process))
        if self.closes_s < NEVER:
            self.system.at(max(self.closes_s, self.system.now), lambda: process._end(0))

    def _lose(self, process: VirtualProcess) -> None:
        if process.exitcode is None:
            self.admission.lose(process.node)
            process._end(EXIT_LOST)


class ManyHosts(VirtualSystem):
    """A system in which several programs run at once. Each is a thread, and one of them runs at a time.

    A program that waits passes control on. The first one in order whose wait is over goes on; if there is none, time does.
    """

    def __init__(self, fate_of: Callable[[Credential], Fate], monkeypatch: pytest.MonkeyPatch) -> None:
        super().__init__(fate_of, monkeypatch)
        self._turn = threading.Semaphore(0)
        self._programs: dict[threading.Thread, threading.Semaphore] = {}
        self._waiting: dict[threading.Thread, tuple[Sequence[Any], float]] = {}

    def run(self, programs: Sequence[tuple[float, Callable[[], Any]]]) -> list[Any]:
        """Run programs that start at their times [s], until all have ended, and return what each returned."""
        results: list[Any] = [None] * len(programs)

        def work(number: int) -> None:
            start_s, program = programs[number]
            self._programs[threading.current_thread()].acquire()
            self.wait([], start_s - self.now)
            results[number] = program()
            del self._programs[threading.current_thread()]
            self._turn.release()

        threads = [threading.Thread(target=work, args=(number,), daemon=True) for number in range(len(programs))]
        self._programs = {thread: threading.Semaphore(0) for thread in threads}
        for thread in threads:
            thread.start()
        while self._programs:
            able = [thread for thread in self._programs if self._can_go_on(thread)]
            if able:
                self._programs[able[0]].release()
                assert self._turn.acquire(timeout=60.0), "a program neither waits nor ends"
            else:
                self._advance()
        for thread in threads:
            thread.join()
        return results

    def wait(self, things: Sequence[Any], timeout_s: float | None = None) -> list[Any]:
        """Return those of `things` that are ready, once one is, or [] after `timeout_s`; other programs run meanwhile."""
        thread = threading.current_thread()
        self._waiting[thread] = things, NEVER if timeout_s is None else self.now + timeout_s
        self._turn.release()
        self._programs[thread].acquire()
        del self._waiting[thread]
        return self._ready(things)

    def _can_go_on(self, thread: threading.Thread) -> bool:
        if thread not in self._waiting:
            return True
        things, end_s = self._waiting[thread]
        return end_s <= self.now or bool(self._ready(things))

    def _advance(self) -> None:
        """Let the next event happen, or the first wait end."""
        next_s = self._events[0][0] if self._events else NEVER
        end_s = min(end_s for _, end_s in self._waiting.values())
        assert min(next_s, end_s) < NEVER, "all programs wait for ever"
        self.now = max(self.now, min(next_s, end_s))
        if next_s <= end_s:
            self._pop()
