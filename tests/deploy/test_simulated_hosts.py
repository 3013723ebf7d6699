"""Hosts that are late, vanish, return or are interrupted, in virtual time: `run_robots`, the supervisor and the admission of
nodes are the real ones. Seed N of a schedule is seed N here."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from seeds import explored
from virtual_hosts import DEADLINE_S, LATENCY_S, ManyHosts, VirtualWorld
from virtual_network import LEASE_S
from virtual_processes import NEVER, VirtualSystem

from zwerm.agents.runtime.process import EXIT_LOST, EXIT_REFUSED
from zwerm.deploy.supervisor import JOINING_MAX, LEAVE_WAIT_S, TERMINATE_WAIT_S
from zwerm.errors import LinkError

SEEDS = explored(100)
END_S = LEAVE_WAIT_S + TERMINATE_WAIT_S + LATENCY_S


def test_a_host_ends_with_its_world_or_says_which_robot_did_not_join(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes = dict.fromkeys(("joined", "late", "outage"), 0)
    for seed in SEEDS:
        world = VirtualWorld(seed, tmp_path, monkeypatch, VirtualSystem)
        world.opens_s = world.draw.choice((0.0, world.draw.uniform(0.0, 2 * DEADLINE_S)))
        world.closes_s = world.opens_s + 200.0
        if world.draw.random() < 0.5:  # an outage that heals before anybody gives up
            world.cut_s = world.opens_s + 100.0
            world.mended_s = world.cut_s + world.draw.uniform(0.1, LEASE_S - 0.1)
        codes, said = world.attempt()
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
        world = VirtualWorld(seed, tmp_path, monkeypatch, VirtualSystem)
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
        world = VirtualWorld(seed, tmp_path, monkeypatch, VirtualSystem)
        world.opens_s, world.closes_s = world.draw.uniform(0.0, 30.0), 60.0
        world.system.interrupt_at_s = world.draw.uniform(0.0, 80.0)
        try:
            world.run_host()
        except KeyboardInterrupt:
            interrupted += 1
        world.system.interrupt_at_s = NEVER
        assert world.system.living() == [], seed
    assert interrupted > len(SEEDS) // 2


def test_hosts_at_once_do_not_disturb_each_other_whatever_becomes_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = dict.fromkeys(("cut", "short", "thief", "late"), 0)
    for seed in SEEDS:
        world = VirtualWorld(seed, tmp_path, monkeypatch, ManyHosts)
        system, draw = world.system, world.draw
        assert isinstance(system, ManyHosts)
        nodes = [each.node for each in world.credentials.nodes]
        world.closes_s, world.cut_s = 300.0, draw.uniform(70.0, 150.0)
        short = draw.random() < 0.3
        world.mended_s = world.cut_s + (
            draw.uniform(0.1, LEASE_S - 0.1) if short else draw.uniform(LEASE_S + 0.1, 40.0)
        )
        others = [node for node in nodes if node not in world.own]
        slices = [others[number::3] for number in range(3) if others[number::3]]
        starts = [draw.choice((0.0, draw.uniform(0.0, 250.0))) for _ in slices]
        hosts: list[tuple[float, Callable[[], tuple[dict[int, int], str]]]] = [
            (0.0, world.attempt),
            *((at, partial(world.attempt, own)) for at, own in zip(starts, slices, strict=True)),
        ]
        stolen = draw.choice([world.own, *slices])
        hosts.append((draw.uniform(60.0, 65.0) if stolen is world.own else 290.0, partial(world.attempt, stolen)))
        hosts.append((200.0, world.attempt))  # the host that was cut off returns, or a second one has its keys
        (first, *rest, thief, returned) = system.run(hosts)
        lost = dict.fromkeys(world.own, 0 if short else EXIT_LOST)
        assert first == (lost, ""), seed
        for own, ended in zip(slices, rest, strict=True):
            assert ended == (dict.fromkeys(own, 0), ""), (seed, "another host has disturbed this one")
        for codes, said in (thief, returned):
            assert not codes, (seed, "one node has joined twice")
            assert f"ended with exit code {EXIT_REFUSED} before it joined" in said, (seed, said)
        assert set(world.admission.joined) == set(nodes if short else others), seed
        assert system.living() == [], seed
        for kind, was in (
            ("cut", not short),
            ("short", short),
            ("thief", stolen is world.own),
            ("late", max(starts, default=0.0) > 100.0),
        ):
            kinds[kind] += was
    assert min(kinds.values()) > len(SEEDS) // 10, kinds
