"""A leader that a wall stopped tries its other directions at once, and its follower knows by when it would be back."""

import math

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, PathVector, SeenRobot, StateBeacon
from zwerm.agents.sensor_coverage.messages.pushes import AllSettled, LeaderReady, PushDone, RedundantPushEnd, SlotMemory
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult, back_ticks, deploy
from zwerm.agents.sensor_coverage.protocols.push_part import TELL_TICKS, VACATED_TICKS
from zwerm.agents.sensor_coverage.protocols.token_push import TokenPush
from zwerm.deploy.node_specs import node_specs
from zwerm.scenario.load import load

ME, AHEAD, BEHIND = 3, 5, 4
PUSH = 7


def robot() -> LocalRobot:
    found = Node(*node_specs(load("sensor-coverage", ("robots.count=14", "services.path=gradient")), 1)[ME])._controller
    assert isinstance(found, LocalRobot)
    return found


def leading() -> tuple[LocalRobot, TokenPush]:
    """Return robot 3, which leads a push at slot 8, the end of a single file, with robot 4 behind it at slot 6."""
    found = robot()
    local_map = found.local_map
    local_map.occupy(8)
    local_map.heading = 0.0
    found.situation.motion.frame.seen = {BEHIND: math.pi}
    seen = (SeenRobot(ME, local_map.epoch, 8, 0.0),)
    local_map.receive(BEHIND, StateBeacon(1, 6, 0, False, False, 1, seen, (), (), NO_PATH_VECTOR), 1)
    local_map.update_bearings({BEHIND: math.pi})
    local_map.update_plans()
    push = found.pushing._join(PUSH, PUSH, ((6, BEHIND), (8, ME)), BEHIND)
    push.lead()
    push._plan = local_map.best_plan()
    assert push._plan is not None
    push._write_ready(BEHIND, push._plan)
    push._deploy()
    return found, push


def stopped(found: LocalRobot, push: TokenPush, seen: bool = True) -> None:
    """A wall stops the leader, and it is back, where it sees its follower, or does not."""
    found.situation.motion.frame.seen = {BEHIND: math.pi} if seen else {}
    push._blocked(DriveResult(False, driven_m=0.1, touched=(0.0,)))


def test_a_leader_tries_both_sides_of_its_edge_one_after_the_other_in_one_push() -> None:
    """Directions into its gap come in another push: edges of other robots have priority."""
    found, push = leading()
    tried = []
    while push.phase in ("deploying", "offering"):
        assert push._plan is not None
        assert push._plan.key not in tried
        tried.append(push._plan.key)
        stopped(found, push)
        if push.phase == "offering":
            push.acknowledged(LeaderReady(PUSH, (), SlotMemory(8, (), (), (), (), (), ()), 0), lost=False)
    assert tried == [(6, 8, -1), (6, 8, 1)]
    assert push.phase == "closing"


def test_a_leader_that_does_not_see_its_follower_looks_for_it_before_it_ends_the_push() -> None:
    found, push = leading()
    stopped(found, push, seen=False)
    assert push.phase == "rejoining"
    for _ in range(40):
        velocity = found.situation.advance()
        found.situation.motion.frame.x_m += 0.1 * velocity.forward_m_s
        found.situation.motion.frame.seen = {BEHIND: math.pi} if found.situation.motion.frame.x_m < -0.03 else {}
    assert push.phase == "closing"
    assert -0.12 < found.situation.motion.frame.x_m < -0.03, "it stays where it sees its follower"


def armed(seen: bool, ticks: int) -> tuple[LocalRobot, TokenPush]:
    """Return robot 3, whose leader is robot 5, and knows that it is back after `ticks`, 0 if it does not."""
    found = robot()
    found.situation.motion.frame.seen = {AHEAD: 0.0} if seen else {}
    push = found.pushing._join(PUSH, PUSH, ((6, ME), (8, AHEAD)), None)
    memory = SlotMemory(8, (), (), (), (), (), ())
    push.receive(LeaderReady(PUSH, ((6, ME), (8, AHEAD)), memory, 0, back_ticks=ticks))
    return found, push


@pytest.mark.parametrize(
    ("seen", "ticks", "goes_after"),
    [(True, 30, 30), (True, 0, VACATED_TICKS), (False, 30, VACATED_TICKS)],
    ids=["it knows when it is back", "it does not know", "out of sight from the start"],
)
def test_a_follower_goes_once_a_stopped_leader_would_be_back_in_sight(seen: bool, ticks: int, goes_after: int) -> None:
    found, push = armed(seen, ticks)
    found.situation.motion.frame.seen = {}
    went = None
    for tick in range(1, 2 * VACATED_TICKS):
        found.situation.tick = tick
        push.poll()
        if push.phase != "armed":
            went = tick
            break
    assert went == goes_after + 1


def test_a_follower_stays_while_its_leader_is_in_sight_again_in_time() -> None:
    found, push = armed(True, 30)
    for tick in range(1, VACATED_TICKS):
        found.situation.tick = tick
        found.situation.motion.frame.seen = {AHEAD: 0.0} if tick % 30 == 0 else {}
        push.poll()
    assert push.phase == "armed"


def test_a_follower_that_is_on_its_way_is_not_armed_again() -> None:
    _, push = armed(True, 30)
    push.leader_vacated()
    assert push.phase == "following"
    push.receive(LeaderReady(PUSH, ((6, ME), (8, AHEAD)), SlotMemory(8, (), (), (), (), (), ()), 1, back_ticks=30))
    assert push.phase == "following"


@pytest.mark.parametrize("sees_base", [False, True])
def test_the_rear_of_a_push_that_does_not_see_the_base_reports_the_end_by_way_of_others(sees_base: bool) -> None:
    """Noise may have displaced its slot out of the base's sight, and the base would wait for 200 s."""
    found = robot()
    found.situation.motion.frame.seen = {AHEAD: 0.0} | ({0: 1.0} if sees_base else {})
    found.local_map.occupy(8)
    found.local_map.heading = 0.0
    seen = (SeenRobot(ME, found.local_map.epoch, 8, 0.0),)
    found.local_map.receive(AHEAD, StateBeacon(1, 9, 0, False, False, 1, seen, (), (), NO_PATH_VECTOR), 1)
    found.local_map.update_bearings({AHEAD: 0.0})
    found.local_map.path_vectors.receive(AHEAD, PathVector(1, 9, None, home=1))
    push = found.pushing._join(PUSH, PUSH, ((8, ME), (9, AHEAD)), 0)
    push.end = PushDone(PUSH)
    push._enter("telling")
    found.situation.tick = TELL_TICKS + 1
    found.pushing.poll(found.situation.tick)
    assert found.pushing.pool is not None
    pending = found.pushing.pool._pending
    assert pending == ([] if sees_base else [RedundantPushEnd(PUSH, True, True)])


@pytest.mark.parametrize("bounded", [True, False])
def test_a_bounded_deployment_that_something_slows_down_is_back_in_time(bounded: bool) -> None:
    motion = robot().situation.motion
    ticks, clear, furthest_m = 0, False, 0.0

    def cleared() -> None:
        nonlocal clear
        clear = True

    for velocity in deploy(motion, 0.0, 0.95, 0.9, cleared, bounded):
        slowed = 0.3 if velocity.forward_m_s > 0.0 else 1.0
        motion.frame.x_m += 0.1 * slowed * velocity.forward_m_s
        furthest_m = max(furthest_m, motion.frame.x_m)
        ticks += 1
    assert clear is not bounded
    if bounded:
        assert 0.3 < furthest_m < 0.6
        assert motion.frame.x_m == pytest.approx(0.0, abs=0.01)
        assert ticks <= back_ticks(motion, 0.9) < VACATED_TICKS


@pytest.mark.parametrize("push", [PUSH, PUSH + 1], ids=["the push that is over", "another push"])
def test_a_robot_that_missed_the_end_of_its_push_hears_it_when_it_reports_again(push: int) -> None:
    """It was out of sight of the robot ahead, and would wait for it for up to a minute."""
    found = robot()
    found.situation.motion.frame.seen = {BEHIND: 0.0}
    found.pushing._join(PUSH, PUSH, ((6, BEHIND), (8, ME)), BEHIND)
    assert found.push is not None
    found.push.end = PushDone(PUSH)
    found.pushing._leave(found.push)
    written = []
    found.situation.mailbox.write = lambda to, body: written.append((to, body))  # type: ignore[method-assign]
    found.pushing.receive(BEHIND, AllSettled(push), 1)
    assert written == ([(BEHIND, PushDone(PUSH))] if push == PUSH else [])
