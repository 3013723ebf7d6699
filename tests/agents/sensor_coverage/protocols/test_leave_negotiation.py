"""Departures of robots: agreements over a radio that loses half of all messages, and the checker of a run."""

import random

import networkx
import numpy as np
import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.locks import ListRequest
from zwerm.agents.sensor_coverage.messages.peers import PeerMessage, read, write
from zwerm.agents.sensor_coverage.messages.snapshots import MembershipSnapshot, decode_snapshot, encode_snapshot
from zwerm.agents.sensor_coverage.protocols.leave_negotiation import LeaveNegotiation
from zwerm.deploy.node_specs import node_specs
from zwerm.link.memory import MemoryLink
from zwerm.maths.simplicial import FlagComplex, betti
from zwerm.run.assembly import assemble
from zwerm.run.measurement import truth_of
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Command
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.metrics.sensor_coverage import removals
from zwerm.world.world import World

DT_S = 0.1
CLOSE = ("robots.parameters.margin_m=0.45", "base.parameters.margin_m=0.45")
HALL = ("arena.size_m=[2.6,2.2]", "base.pose=[0.2,1.1,0.0]", "robots.count=30")
LINK = ("services.path=gradient", "services.redundancy=link")
# A robot that has followed a wall has no slot until it is pushed again, and has not left by agreement.
PAPER = ('robots.parameters.walls="paper"', 'base.parameters.walls="paper"')


def leave_at_random(seed: int, loss: float, wanting: int = 12, ticks: int = 400) -> tuple[int, int]:
    """Let robots at random places leave; return how many did, and how often that changed b0 or b1."""
    luck = random.Random(seed)
    graph = networkx.random_geometric_graph(wanting, 0.5, seed=seed)
    robots = {
        node: LeaveNegotiation(node, DT_S, np.random.Generator(np.random.Philox(seed + node)), True) for node in graph
    }
    there = dict.fromkeys(robots)
    air: list[tuple[int, int, PeerMessage]] = []
    left = changed = 0
    for tick in range(ticks):
        lists = {node: sorted(each for each in graph[node] if each in there) for node in there}
        for node, robot in robots.items():
            robot.observe(tick, sorted(each for each in graph[node] if each in there))
            robot.update(node in there)
        heard, air = air, []
        for sender, receiver, word in heard:
            if luck.random() >= loss:
                said = read(write(word))
                assert said == word
                robots[receiver].receive(sender, said, tick)  # type: ignore[arg-type]
        for node, robot in robots.items():
            whole = FlagComplex(lists)
            robot.wanted = node in there and betti(whole) == betti(whole.without([node]))
            robot.poll(tick)
            if robot.left:
                now = FlagComplex({each: [other for other in lists[each] if other in there] for each in there})
                changed += betti(now) != betti(now.without([node]))
                left += 1
                del there[node]
                robot.update(stands=False)
            for to, word in robot.outgoing():
                air += [(node, each, word) for each in (graph[node] if to is None else [to])]
    return left, changed


@pytest.mark.parametrize("loss", [0.0, 0.5])
def test_robots_that_leave_by_agreement_never_open_a_hole(loss: float) -> None:
    found = [leave_at_random(seed, loss) for seed in range(4)]
    assert sum(left for left, _ in found) > 8
    assert sum(changed for _, changed in found) == 0


def test_a_robot_that_granted_a_lock_stands_still_until_the_lock_is_released() -> None:
    first, second = (LeaveNegotiation(node, DT_S, np.random.Generator(np.random.Philox(node)), True) for node in (1, 2))
    ticks = iter(range(100))

    def turn(wants: bool) -> bool:
        tick = next(ticks)
        for robot, other in ((first, 2), (second, 1)):
            robot.observe(tick, [other])
            robot.update(stands=True)
        first.wanted = wants
        first.poll(tick)
        second.poll(tick)
        for sender, receiver, at in ((first, second, 1), (second, first, 2)):
            for _, word in sender.outgoing():
                assert not isinstance(word, ListRequest) or receiver is second
                receiver.receive(at, word, tick)
        return first.left

    assert not second.locked
    while not second.locked:
        assert not turn(wants=True)
    assert not first.locked
    while second.locked:
        turn(wants=False)
    assert next(ticks) < 50, "it was told, and did not wait for the lease"


# --- in a run -------------------------------------------------------------------------------------------------------


def drive(scenario: Scenario, seed: int) -> tuple[World, list[LocalRobot]]:
    """Run inline, check that no slot has two standing robots, and return the world and the released robots."""
    world = assemble(scenario, seed)
    nodes = {node: Node(*each) for node, each in node_specs(scenario, seed).items()}

    def robots() -> list[LocalRobot]:
        out = [nodes[robot]._controller for robot in world.scene.present_ids().tolist() if robot]
        return [each for each in out if isinstance(each, LocalRobot)]

    def look(world: World) -> None:
        held = [each.local_map.slot for each in robots() if each.push is None and each.local_map.slot != NOWHERE]
        assert len(held) == len(set(held))

    LockStep(world, MemoryLink({node: each.answer for node, each in nodes.items()}), [look]).run()
    return world, robots()


def test_redundant_robots_leave_and_are_pushed_again_under_loss_and_no_robot_is_lost() -> None:
    settings = (*HALL, *CLOSE, *LINK, *PAPER, "radio.loss=0.1", "time.duration_s=240.0")
    for seed in range(1, 9):  # not in every run there is anybody to spare
        world, robots = drive(load("sensor-coverage", settings), seed)
        changes = [decode_snapshot(each.snapshot) for each in world.telemetry.snapshots]
        left, entered = changes.count(MembershipSnapshot(False)), changes.count(MembershipSnapshot(True))
        redundant = [each.node for each in robots if each.local_map.redundant]
        assert len(redundant) == left - entered
        homeless = [each.node for each in robots if each.local_map.slot == NOWHERE]
        assert len(homeless) <= 2, "one waits at the base, and one may be on its way"
        if entered:
            break
    result = run("sensor-coverage", seed=seed, runner="processes", overrides=settings)
    assert result.trace == world.trace.hex()
    assert result.metrics["removals"] >= 1
    assert result.metrics["unsafe_removals"] == 0


def test_the_removal_metric_finds_a_removal_that_opens_a_hole() -> None:
    scenario = load("sensor-coverage", (*LINK, "robots.count=8", "base.pose=[1.0,3.75,0.0]"))
    world = assemble(scenario, 1)
    around = [(2.0 + 0.9 * np.cos(a), 3.75 + 0.9 * np.sin(a)) for a in np.linspace(0.0, 2.0 * np.pi, 7)[:-1]]
    world.scene.position[1:8] = [(2.0, 3.75), *around]
    world.scene.present[:] = True
    world.scene.present[0] = False

    def report(node: int, member: bool) -> None:
        command = Command(snapshot=encode_snapshot(MembershipSnapshot(member)))
        world.telemetry.accept(world.scene, node, command)

    for node in (1, 2):  # the hub of a wheel, and then one of its rim: a hole comes, and goes
        report(node, False)
        assert removals(truth_of(world), 1.0) == {"removals": node, "unsafe_removals": node}
    report(1, True)
    report(2, True)
    report(2, False)
    assert removals(truth_of(world), 1.0) == {"removals": 3.0, "unsafe_removals": 2.0}
