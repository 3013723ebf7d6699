"""Probes go at once where their robots do not see each other: a robot that is away from its slot is no witness."""

import math
from collections.abc import Generator, Sequence
from itertools import permutations
from typing import Any

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_plans import WallPlans
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, NearArc
from zwerm.agents.sensor_coverage.messages.commands import Sighting, Waypoint
from zwerm.coordinator.sensor_coverage.wall_walks import WallWalks
from zwerm.maths.simplicial import FlagComplex
from zwerm.run.runner import run

# Three rooms, with doors of 0.3 m.
ROOMS = (
    "arena.polygon=[[0,0],[1.2,0],[1.2,0.4],[1.3,0.4],[1.3,0],[2.5,0],[2.5,0.8],[2.6,0.8],[2.6,0],[3.6,0],[3.6,1.2],"
    "[2.6,1.2],[2.6,1.1],[2.5,1.1],[2.5,1.2],[1.3,1.2],[1.3,0.7],[1.2,0.7],[1.2,1.2],[0,1.2]]"
)


def test_probes_at_once_are_of_slots_that_do_not_see_each_other() -> None:
    """A station and five robots in a line. Each robot has one open arc."""
    line = {slot: {each: 0.0 for each in (slot - 1, slot + 1) if 0 <= each < 6} for slot in range(6)}
    scan, slots = ScanResult(line, FlagComplex(line), (0,)), Slots()
    slots.near = {slot: [NearArc(Arc(0.6, math.tau - 1.2), 1)] for slot in range(6)}
    walls = WallPlans(PlannerParameters(), slots, SwarmProof())
    assert [plan.mover for plan in walls.probes(scan)] == [1, 3, 5]
    assert [plan.mover for plan in walls.probes(scan)] == [2, 4]
    assert walls.probes(scan) == []


def test_a_robot_that_moves_is_no_witness_of_a_walk() -> None:
    slots = Slots()
    for robot in (7, 8, 9):
        slots.add(robot)
        slots.heading[robot], slots.frame[robot] = 0.0, 7
    point = Waypoint(0.1, 0.0, (Sighting(8, 0.5), Sighting(9, 1.0)), (0.0,), ())
    of = slots.slot_of()
    for moving, seen in (((), {of[8], of[9]}), ((9,), {of[8]})):
        number = slots.take_walk(7, 1, [point], moving=moving)
        assert set(slots.walks[number].points[0].seen) == seen


@pytest.mark.parametrize("noise_rad", [0.0, math.pi / 72.0])
def test_a_robot_that_probes_is_no_witness_of_another_probe(noise_rad: float, monkeypatch: pytest.MonkeyPatch) -> None:
    probes = list[tuple[int, float, float, set[int]]]()  # the robot, from when to when [s], and its witnesses
    witnesses: dict[int, set[int]] = {}
    probe, take_walk = WallWalks.probe, Slots.take_walk

    def watched_probe(self: WallWalks, plans: Sequence[Plan], *more: Any) -> Generator[Any, Any, Any]:
        began_s, robot = self._mailbox.now_s, self._slots.occupant[plans[0].mover]
        witnesses[robot] = set()
        moved = yield from probe(self, plans, *more)
        probes.append((robot, began_s, self._mailbox.now_s, witnesses.pop(robot)))
        return moved

    def watched_walk(self: Slots, robot: int, *arguments: Any, **options: Any) -> int:
        number = take_walk(self, robot, *arguments, **options)
        if robot in witnesses:
            seen = {slot for each in self.walks[number].points for slot in each.seen}
            witnesses[robot] |= {self.occupant[slot] for slot in seen} - {robot}
        return number

    monkeypatch.setattr(WallWalks, "probe", watched_probe)
    monkeypatch.setattr(Slots, "take_walk", watched_walk)
    counted = at_once = away = 0
    for seed in range(1, 7):
        if counted > 20 and at_once > 5:
            break
        probes.clear()
        settings = (
            ROOMS,
            f"base.pose=[0.4,0.6,{0.7 * seed}]",
            "robots.count=40",
            f"robots.sensors.0.sd_rad={noise_rad}",
            "time.duration_s=1000.0",
        )
        run("sensor-coverage-narrow", seed, "inline", settings)
        counted += sum(len(seen) for *_, seen in probes)
        for (robot, began_s, ended_s, seen), (other, its_began_s, its_ended_s, _) in permutations(probes, 2):
            if robot != other and began_s < its_ended_s and its_began_s < ended_s:
                at_once += 1
                away += other in seen
    assert counted > 20
    assert at_once > 5
    assert away == 0
