"""Leaving as a robot does it: agreements over a radio that loses half of all words, and the checker that watches a run."""

import random

import networkx
import numpy as np
import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.peers import NOWHERE, ListRequest, Word, read, write
from zwerm.agents.sensor_coverage.protocols.leave_negotiation import LeaveNegotiation
from zwerm.deploy.node_specs import node_specs
from zwerm.link.memory import MemoryLink
from zwerm.maths.simplicial import FlagComplex, betti
from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Command
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.metrics.removals import removals
from zwerm.world.world import World

DT_S = 0.1
CLOSE = ("robots.parameters.margin_m=0.45", "base.parameters.margin_m=0.45")
HALL = ("arena.size_m=[2.6,2.2]", "base.pose=[0.2,1.1,0.0]", "robots.count=30")
LINK = ("services.path=gradient", "services.redundancy=link")


def leave_at_random(seed: int, loss: float, wanting: int = 12, ticks: int = 400) -> tuple[int, int]:
    """Let robots at random places leave; return how many did, and how often that changed b0 or b1."""
    luck = random.Random(seed)
    graph = networkx.random_geometric_graph(wanting, 0.5, seed=seed)
    robots = {
        node: LeaveNegotiation(node, DT_S, np.random.Generator(np.random.Philox(seed + node)), True) for node in graph
    }
    there = dict.fromkeys(robots)
    air: list[tuple[int, int, Word]] = []
    left = changed = 0
    for tick in range(ticks):
        lists = {node: sorted(each for each in graph[node] if each in there) for node in there}
        for node, robot in robots.items():
            robot.watch(tick, sorted(each for each in graph[node] if each in there))
            robot.note(node in there)
        heard, air = air, []
        for sender, receiver, word in heard:
            if luck.random() >= loss:
                said = read(write(word))
                assert said == word
                robots[receiver].hear(sender, said)  # type: ignore[arg-type]
        for node, robot in robots.items():
            whole = FlagComplex(lists)
            redundant = node in there and betti(whole) == betti(whole.without([node]))
            if robot.turn(redundant):
                now = FlagComplex({each: [other for other in lists[each] if other in there] for each in there})
                changed += betti(now) != betti(now.without([node]))
                left += 1
                del there[node]
                robot.note(stands=False)
            for to, word in robot.letters():
                air += [(node, each, word) for each in (graph[node] if to is None else [to])]
    return left, changed


@pytest.mark.parametrize("loss", [0.0, 0.5])
def test_robots_leave_by_agreement_and_never_open_a_hole(loss: float) -> None:
    found = [leave_at_random(seed, loss) for seed in range(4)]
    assert sum(left for left, _ in found) > 8
    assert sum(changed for _, changed in found) == 0


def test_a_robot_that_has_granted_a_lock_stands_still_until_it_is_over() -> None:
    first, second = (LeaveNegotiation(node, DT_S, np.random.Generator(np.random.Philox(node)), True) for node in (1, 2))
    ticks = iter(range(100))

    def turn(wants: bool) -> bool:
        tick = next(ticks)
        for robot, other in ((first, 2), (second, 1)):
            robot.watch(tick, [other])
            robot.note(stands=True)
        left = first.turn(wants)
        second.turn(redundant=False)
        for sender, receiver, at in ((first, second, 1), (second, first, 2)):
            for _, word in sender.letters():
                assert not isinstance(word, ListRequest) or receiver is second
                receiver.hear(at, word)  # type: ignore[arg-type]
        return left

    assert not second.locked
    while not second.locked:
        assert not turn(wants=True)
    assert not first.locked
    while second.locked:
        turn(wants=False)
    assert next(ticks) < 50, "it was told, and did not wait for the lease"


# --- in a run -------------------------------------------------------------------------------------------------------


def drive(scenario: Scenario, seed: int) -> tuple[World, list[LocalRobot]]:
    """Run inline, watch that no place has two robots that stand, and return the world and the robots that are out."""
    world = assemble(scenario, seed)
    nodes = {node: Node(*each) for node, each in node_specs(scenario, seed).items()}

    def robots() -> list[LocalRobot]:
        out = [nodes[robot]._controller for robot in world.scene.present_ids().tolist() if robot]
        return [each for each in out if isinstance(each, LocalRobot)]

    def look(world: World) -> None:
        held = [each.vicinity.place for each in robots() if each.push is None and each.vicinity.place != NOWHERE]
        assert len(held) == len(set(held))

    LockStep(world, MemoryLink({node: each.answer for node, each in nodes.items()}), look).run()
    return world, robots()


def test_robots_are_freed_and_pushed_again_while_words_are_lost_and_nobody_is_lost() -> None:
    settings = (*HALL, *CLOSE, *LINK, "radio.loss=0.1", "time.duration_s=240.0")
    for seed in range(1, 9):  # not in every run there is anybody to spare
        world, robots = drive(load("sensor-coverage", settings), seed)
        told = [each.told["removal"] for each in world.audience.told if "removal" in each.told]
        spare = [each.node for each in robots if each.vicinity.spare]
        assert len(spare) == sum("out" in each for each in told) - sum("in" in each for each in told)
        homeless = [each.node for each in robots if each.vicinity.place == NOWHERE]
        assert len(homeless) <= 2, "one waits at the base, and one may be on its way"
        if any("in" in each for each in told):
            break
    result = run("sensor-coverage", seed=seed, runner="processes", overrides=settings)
    assert result.trace == world.trace.hex()
    assert result.metrics["removals"] >= 1
    assert result.metrics["unsafe_removals"] == 0


def test_the_checker_finds_a_removal_that_opens_a_hole() -> None:
    scenario = load("sensor-coverage", (*LINK, "robots.count=8", "base.pose=[1.0,3.75,0.0]"))
    world = assemble(scenario, 1)
    around = [(2.0 + 0.9 * np.cos(a), 3.75 + 0.9 * np.sin(a)) for a in np.linspace(0.0, 2.0 * np.pi, 7)[:-1]]
    world.scene.position[1:8] = [(2.0, 3.75), *around]
    world.scene.present[:] = True
    world.scene.present[0] = False
    for node in (1, 2):  # the hub of a wheel, and then one of its rim: a hole comes, and goes
        world.audience.hear(world.scene, node, Command(told={"removal": {"out": node}}), decides=False)
        assert removals(world, 1.0) == {"removals": node, "unsafe_removals": node}
    world.audience.hear(world.scene, 1, Command(told={"removal": {"in": 1}}), decides=False)
    world.audience.hear(world.scene, 2, Command(told={"removal": {"in": 2}}), decides=False)
    world.audience.hear(world.scene, 2, Command(told={"removal": {"out": 2}}), decides=False)
    assert removals(world, 1.0) == {"removals": 3.0, "unsafe_removals": 2.0}
