"""Hosts that are late, vanish, return or are interrupted, in virtual time: `run_robots`, the supervisor and the admission of
nodes are the real ones. Seed N of a schedule is seed N here."""

import random
from pathlib import Path

import pytest
from virtual_network import LEASE_S
from virtual_processes import NEVER, Fate, VirtualProcess, VirtualSystem

from zwerm.agents.runtime.process import EXIT_LOST, EXIT_REFUSED
from zwerm.deploy import remote
from zwerm.deploy.identity import issue, save, slice_of
from zwerm.deploy.supervisor import JOINING_MAX, LEAVE_WAIT_S, TERMINATE_WAIT_S
from zwerm.errors import LinkError
from zwerm.link.admission import Admission, ExpectedNode
from zwerm.link.session import Credential
from zwerm.wire.messages import Hello

SEEDS = range(200)
DEADLINE_S = 60.0
LATENCY_S = 2.0
END_S = LEAVE_WAIT_S + TERMINATE_WAIT_S + LATENCY_S


class VirtualWorld:
    """A world that listens from `opens_s` to `closes_s`, and cannot be reached by this host from `cut_s` to `mended_s`."""

    def __init__(self, seed: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.draw = random.Random(seed)
        self.system = VirtualSystem(self._start, monkeypatch)
        monkeypatch.setattr(remote, "prepare", lambda robots: None)
        monkeypatch.setattr(remote, "time", self.system)
        monkeypatch.setattr("zwerm.deploy.supervisor.multiprocessing.get_context", lambda kind: self.system)
        credentials = issue("run", range(self.draw.randint(2, 50)))
        self.own = sorted(self.draw.sample(range(len(credentials.nodes)), self.draw.randint(1, len(credentials.nodes))))
        self.admission = Admission({each.node: ExpectedNode(1, "", b"") for each in credentials.nodes})
        self.opens_s, self.closes_s, self.cut_s, self.mended_s = 0.0, NEVER, NEVER, NEVER
        self._keys = folder / f"{seed}.key"
        save(slice_of(credentials, self.own), self._keys)

    def run_host(self) -> dict[int, int]:
        """Run the robots of this host, as `zwerm robot` does."""
        return remote.run_robots("tcp/127.0.0.1:1", self._keys, deadline_s=DEADLINE_S)

    def _start(self, credential: Credential) -> Fate:
        """Let a robot join as soon as the world can be reached, be refused by it, or give up after its deadline."""
        system = self.system
        reached_s = max(system.now, self.opens_s) + self.draw.uniform(0.1, LATENCY_S)
        if self.cut_s < reached_s < self.mended_s:
            reached_s = self.mended_s + self.draw.uniform(0.1, LATENCY_S)
        if reached_s > system.now + DEADLINE_S:
            return Fate(ends_s=DEADLINE_S, exit_code=EXIT_REFUSED)
        system.at(reached_s, lambda: self._greet(credential))
        return Fate()

    def _process(self, node: int) -> VirtualProcess:
        return next(each for each in reversed(self.system.started) if each.node == node)

    def _greet(self, credential: Credential) -> None:
        process = self._process(credential.node)
        if process.exitcode is not None:
            return
        if self.admission.greet(credential.node, Hello(credential.node, credential.incarnation)):
            process._end(EXIT_REFUSED)
            return
        process._join()
        lost_s = max(self.cut_s, self.system.now) + LEASE_S
        if self.cut_s < NEVER and self.mended_s > lost_s:
            self.system.at(lost_s, lambda: self._lose(process))
        if self.closes_s < NEVER:
            self.system.at(max(self.closes_s, self.system.now), lambda: process._end(0))

    def _lose(self, process: VirtualProcess) -> None:
        self.admission.lose(process.node)
        process._end(EXIT_LOST)


def attempt(world: VirtualWorld) -> tuple[dict[int, int], str]:
    """Run the robots of a host, and return their exit codes, or why they did not join."""
    try:
        return world.run_host(), ""
    except LinkError as error:
        return {}, str(error)


def test_a_host_ends_with_its_world_or_says_which_robot_did_not_join(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes = dict.fromkeys(("joined", "late", "outage"), 0)
    for seed in SEEDS:
        world = VirtualWorld(seed, tmp_path, monkeypatch)
        world.opens_s = world.draw.choice((0.0, world.draw.uniform(0.0, 2 * DEADLINE_S)))
        world.closes_s = world.opens_s + 200.0
        if world.draw.random() < 0.5:  # an outage that heals before anybody gives up
            world.cut_s = world.opens_s + 100.0
            world.mended_s = world.cut_s + world.draw.uniform(0.1, LEASE_S - 0.1)
        codes, said = attempt(world)
        if said:
            assert world.opens_s + LATENCY_S > DEADLINE_S, (seed, said)
            assert int(said.split()[1]) in set(world.own) - set(world.admission.joined), (seed, said)
            assert world.system.now <= DEADLINE_S + END_S, seed
            outcomes["late"] += 1
        else:
            assert codes == dict.fromkeys(world.own, 0), seed
            assert world.system.now <= world.closes_s + LATENCY_S, seed
            assert set(world.own) == set(world.admission.joined), (seed, "robots of other hosts are not its own")
            outcomes["outage" if world.cut_s < NEVER else "joined"] += 1
        assert world.system.living() == [], seed
        assert world.system.starting_max <= JOINING_MAX, seed
    assert min(outcomes.values()) > len(SEEDS) // 20, outcomes


def test_a_host_that_vanished_ends_within_the_lease_and_is_refused_when_it_returns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = 0
    for seed in SEEDS:
        world = VirtualWorld(seed, tmp_path, monkeypatch)
        world.cut_s = world.draw.uniform(20.0, 100.0)
        world.mended_s = world.cut_s + world.draw.uniform(LEASE_S + 0.1, 40.0)
        assert world.run_host() == dict.fromkeys(world.own, EXIT_LOST), seed
        assert world.system.now <= world.cut_s + LEASE_S + 0.001, seed
        assert world.system.living() == [], seed
        returned_s = world.system.now
        with pytest.raises(LinkError, match=rf"^node \d+ ended with exit code {EXIT_REFUSED} before it joined$"):
            world.run_host()
        refused += 1
        assert not world.admission.joined, (seed, "a lost node was taken back")
        assert world.system.now <= max(returned_s, world.mended_s) + END_S, seed
        assert world.system.living() == [], seed
    assert refused == len(SEEDS)


def test_an_interrupted_host_leaves_no_robot_at_any_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted = 0
    for seed in SEEDS:
        world = VirtualWorld(seed, tmp_path, monkeypatch)
        world.opens_s, world.closes_s = world.draw.uniform(0.0, 30.0), 60.0
        world.system.interrupt_at_s = world.draw.uniform(0.0, 80.0)
        try:
            world.run_host()
        except KeyboardInterrupt:
            interrupted += 1
        world.system.interrupt_at_s = NEVER
        assert world.system.living() == [], seed
    assert interrupted > len(SEEDS) // 2
