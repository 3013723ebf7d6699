"""A robot is taken for a wreck by touch, rest and silence together; facts that name it are void once it is alive."""

import numpy as np
import pytest

from zwerm.agents.robot_teams.mapping.facts import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    End,
    Fact,
    Return,
    SweptSegment,
    TracedArc,
    Void,
    Wreck,
)
from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.motion.manoeuvres import Approach, SliceGrid
from zwerm.agents.robot_teams.motion.pilot import IDLE, RUNNING, Pilot
from zwerm.agents.robot_teams.motion.senses import Beside, Senses
from zwerm.agents.robot_teams.motion.wrecks import STILL_S, TOUCHED_S, WreckWatch
from zwerm.agents.robot_teams.robot import TeamRobot
from zwerm.agents.runtime.contract import Body, Setup
from zwerm.wire.messages import Observation, Pose

DT_S, SILENCE_S = 0.5, 6.0
LONG_TICKS = round((2.0 * SILENCE_S + STILL_S + TOUCHED_S) / DT_S) + 2
WRECK = Wreck(3, 100)


def watched(
    ticks: int, silent: bool = True, gap_m: float = 0.01, moves_m: float = 0.0, reported: tuple[Void, ...] = ()
) -> WreckWatch:
    """Return a watch after it saw robot 3 for so many ticks."""
    watch = WreckWatch(DT_S, SILENCE_S, lambda node, tick: tick if silent else 0)
    for tick in range(ticks):
        beside = Beside(3, 1.0 + moves_m * (tick % 2), 2.0, 1.0, 0.0, gap_m, 0.0, 0.0)
        watch.watch(Senses(tick, 0.5, 2.0, (), (beside,)), reported)
    return watch


def test_a_robot_that_is_touched_rests_and_is_silent_is_a_wreck() -> None:
    assert list(watched(LONG_TICKS).wrecks) == [3]
    assert not watched(round(TOUCHED_S / DT_S)).wrecks


def test_neither_silence_nor_rest_nor_touch_alone_makes_a_wreck() -> None:
    assert not watched(LONG_TICKS, silent=False).wrecks
    assert not watched(LONG_TICKS, gap_m=0.5).wrecks
    assert not watched(LONG_TICKS, moves_m=0.1).wrecks


def test_a_wreck_that_a_teammate_reported_is_known_at_sight_and_only_there() -> None:
    assert watched(1, reported=(Void(1, 1_020, 0, 0, WRECK),)).wrecks == {3: WRECK}
    assert not watched(1, reported=(Void(1, 2_020, 0, 0, WRECK),)).wrecks


def test_a_wreck_that_moves_or_sends_counts_as_alive() -> None:
    watch = watched(1, reported=(Void(1, 1_000, 0, 0, WRECK),))
    watch.watch(Senses(120, 0.5, 2.0, (), (Beside(3, 1.2, 2.0, 1.0, 0.0, 0.2, 0.0, 0.0),)), ())
    assert watch.moved == [3]
    assert not watch.wrecks
    watch = watched(LONG_TICKS)
    tick = watch.wrecks[3].tick
    watch.note_alive(3, tick)
    assert watch.wrecks, "a status from before proves nothing"
    watch.note_alive(3, tick + 1)
    assert not watch.wrecks


# --- the map ----------------------------------------------------------------------------------------------------------


def known(facts: list[Fact]) -> SliceMap:
    slice_map = SliceMap()
    slice_map.merge(facts)
    return slice_map


def arc(start: End, direction: int, stop: End, *wrecks: Wreck) -> TracedArc:
    return TracedArc(start, direction, stop, 950, 0, 0, wrecks)


def room(slices: int) -> list[Fact]:
    facts: list[Fact] = [SweptSegment(k, 0, 5_000) for k in range(slices)]
    for k in range(slices - 1):
        facts += [arc(End(k, side, y), RIGHT, End(k + 1, side, y)) for side, y in ((TOP, 5_000), (BOTTOM, 0))]
    facts.append(arc(End(0, TOP, 5_000), LEFT, End(0, BOTTOM, 0)))
    facts.append(arc(End(slices - 1, TOP, 5_000), RIGHT, End(slices - 1, BOTTOM, 0)))
    return facts


def test_what_a_wreck_hides_is_open_again_once_the_robot_lived_later() -> None:
    facts: list[Fact] = [
        fact for fact in room(3) if not isinstance(fact, TracedArc) or End(1, TOP, 5_000) not in fact[:3]
    ]
    hidden: list[Fact] = [
        *facts,
        Void(1, 950, 4_600, 5_400, WRECK),
        arc(End(0, TOP, 5_000), RIGHT, End(2, TOP, 5_000), WRECK),
    ]
    assert known(hidden).certificate.complete
    assert known([*hidden, Return(3, 100)]).certificate.complete
    again = known([*hidden, Return(3, 101)]).certificate
    assert (End(1, TOP, 5_000), RIGHT) in again.open_ports
    assert again == known([*facts]).certificate
    assert known([*hidden, Return(4, 101)]).certificate.complete


def test_a_later_wreck_of_a_robot_that_returned_holds() -> None:
    facts: list[Fact] = [fact for fact in room(1) if not isinstance(fact, TracedArc)]
    voids: list[Fact] = [Void(0, 0, 4_600, 5_400, WRECK), Void(0, 0, -400, 400, Wreck(3, 300))]
    slice_map = known([*facts, *voids, Return(3, 200)])
    assert slice_map.voids == voids[1:]


def test_a_way_through_a_wreck_is_closed_and_the_way_around_it_is_taken() -> None:
    """The wreck lies on slice 1; robots have traced around it from above, and the segment ends there now."""
    facts = [*room(3), Void(1, 950, 2_500, 3_500, WRECK), SweptSegment(1, 3_540, 5_000, (WRECK,))]
    slice_map = known(facts)
    assert slice_map.certificate.complete
    mate = slice_map.mate(End(1, TOP, 5_000))
    assert mate is not None
    assert mate.stop == End(1, BOTTOM, 3_540)
    assert slice_map.mate(End(1, BOTTOM, 0)) is None
    returned = known([*facts, Return(3, 200)]).mate(End(1, TOP, 5_000))
    assert returned is not None
    assert returned.stop == End(1, BOTTOM, 0)


def test_what_no_way_leads_to_counts_only_from_where_a_way_is_open() -> None:
    beyond: list[Fact] = [SweptSegment(9, 0, 5_000)]
    slice_map = known([*room(2), *beyond])
    assert not slice_map.certificate.complete
    assert slice_map.complete_from(End(0, TOP, 5_000))
    assert not slice_map.complete_from(End(9, TOP, 5_000))
    assert not slice_map.complete_from(None)
    assert not known([*room(2)[:-1], *beyond]).complete_from(End(0, TOP, 5_000))


def test_an_end_that_a_robot_swept_past_counts_for_nothing() -> None:
    grazed = [*room(2), arc(End(0, TOP, 5_000), RIGHT, End(1, TOP, 2_500)), SweptSegment(1, 0, 2_500)]
    assert known(grazed).certificate.complete
    beside = [*room(2), arc(End(0, TOP, 5_000), RIGHT, End(1, TOP, 6_500))]
    assert not known(beside).certificate.complete


@pytest.mark.parametrize(("dead", "ends"), [(True, True), (False, False)])
def test_an_approach_to_an_end_at_which_a_wreck_stands_ends_soon(dead: bool, ends: bool) -> None:
    """The control: a robot that lives may go away, so the approach goes on."""
    beside = Beside(3, 0.0, 1.45, 0.0, -1.0, 0.01, 0.0, 0.0, Wreck(3, 0) if dead else None)
    approach = Approach(End(0, BOTTOM, 1_000), SliceGrid(0.0, 0.95), lambda senses: [])
    steps = [approach.step(Senses(tick, 0.0, 2.0, (), (beside,)), []) for tick in range(30)]
    assert (None in steps) == ends == approach.hidden


@pytest.mark.parametrize("hidden", [True, False])
def test_a_robot_whose_end_a_wreck_hides_looks_for_another_end(hidden: bool) -> None:
    """No way leads from a hidden end, so the lead would give this robot no task, and it would stand in the way."""
    body = Body("holonomic", 0.25, 1.0, 1.0)
    robot = TeamRobot(Setup(0, "robot", DT_S, TeamRobot.sensors, bytes(16), body, ("radio",)))
    robot.map.merge(room(2)[:-1])
    robot.work.at = End(0, TOP, 5_000)
    states = []
    for tick in range(2):
        pose = Pose(0.05, 4.95, 0.0)
        robot.step(Observation(tick, tick * DT_S, touch=(), neighbours=(), pose=pose))
        states.append(robot.pilot.state)
        robot.map.add(Void(0, -300, 4_600 if hidden else 5_600, 5_400 if hidden else 6_400, WRECK))
    assert states == [IDLE, RUNNING if hidden else IDLE]


def robot_at(facts: list[Fact]) -> TeamRobot:
    """Return a robot whose place in the map is the top end of slice 0."""
    body = Body("holonomic", 0.25, 1.0, 1.0)
    robot = TeamRobot(Setup(0, "robot", DT_S, TeamRobot.sensors, bytes(16), body, ("radio",)))
    robot.map.merge(facts)
    robot.work.at = End(0, TOP, 5_000)
    return robot


def answer(robot: TeamRobot, x_m: float, y_m: float, tick: int = 0) -> tuple[bool, str]:
    """Return whether the robot is done, and why it gave up, at (x, y)."""
    pose = Pose(x_m, y_m, 0.0)
    command = robot.step(Observation(tick, tick * DT_S, touch=(), neighbours=(), pose=pose))
    return command.done, command.gave_up


FAR_WRECK = Void(1, 950, 2_500, 3_500, WRECK)


def test_a_robot_that_a_wreck_may_divide_from_its_end_is_not_done_before_it_stands_at_an_end() -> None:
    robot = robot_at(room(2))
    assert answer(robot, 0.5, 3.0) == (True, "")
    robot.map.add(FAR_WRECK)
    assert answer(robot, 0.5, 3.0, 1) == (False, "")
    assert robot.pilot.state == RUNNING, "the robot goes back to its end"
    assert answer(robot, 0.05, 5.0, 2) == (True, "")
    assert answer(robot, 0.5, 3.0, 3) == (True, ""), "others may push it away: the wreck stays where it is"
    robot.map.add(Void(1, 950, 500, 1_500, Wreck(2, 300)))
    assert answer(robot, 0.5, 3.0, 4) == (False, ""), "a new wreck"


@pytest.mark.parametrize(("low_mm", "done"), [(-900, True), (3_000, False)])
def test_a_robot_on_the_swept_segment_of_its_end_is_done_unless_a_wreck_blocks_the_segment(
    low_mm: int, done: bool
) -> None:
    """Another robot may stand at the end itself."""
    robot = robot_at([*room(2), Void(0, 300, low_mm, low_mm + 800, WRECK)])
    assert answer(robot, 0.05, 2.5) == (done, "")


def test_a_robot_gives_up_where_nothing_that_it_reaches_is_open_and_something_else_is() -> None:
    robot = robot_at([*room(2), SweptSegment(9, 0, 5_000)])
    assert answer(robot, 0.0, 5.0) == (False, "blocked: no way leads to 4 open ends and ports")
    robot.map.merge([arc(End(9, side, y), way, End(9, -side, 5_000 - y)) for side, y, way in OVAL])
    assert answer(robot, 0.0, 5.0, 1) == (True, "")


OVAL = ((TOP, 5_000, RIGHT), (TOP, 5_000, LEFT))


@pytest.mark.parametrize(("x_mm", "way", "hidden"), [(6_700, RIGHT, True), (6_700, LEFT, False), (6_600, LEFT, True)])
def test_an_end_at_a_wreck_is_hidden_if_its_open_arc_goes_towards_the_wreck(x_mm: int, way: int, hidden: bool) -> None:
    """The end is 0.01 m farther from the wreck than what the wreck hides. Slice 7 is at x = 6.65 m."""
    beyond: list[Fact] = [
        SweptSegment(7, 0, 5_000),
        arc(End(7, TOP, 5_000), -way, End(7, BOTTOM, 0)),
        arc(End(7, BOTTOM, 0), way, End(7, BOTTOM, 300)),
        SweptSegment(7, 300, 4_300),
        arc(End(7, TOP, 4_300), way, End(7, BOTTOM, 300)),
        Void(7, x_mm, 3_920, 4_990, WRECK),
    ]
    robot = robot_at([*room(2), *beyond])
    assert robot.map.certificate.open_ports[-1] == (End(7, TOP, 5_000), way)
    robot._task.hide_closed_ports()
    assert (End(7, TOP, 5_000) not in [end for end, _ in robot.map.certificate.open_ports]) is hidden


@pytest.mark.parametrize("y_mm", [-1_500, -900, -500, -200, -100, 0, 100])
def test_a_robot_between_a_wall_and_a_wreck_does_not_slide_into_the_wreck(y_mm: int) -> None:
    wall, wreck = (0.0, 1.0), (-0.6, -0.8)
    beside = Beside(2, -0.3, -0.4, *wreck, -0.015, 0.0, 0.0, Wreck(2, 1))
    pilot = Pilot(1, 1.0, 0.05, np.random.default_rng(1))
    pilot.start(Approach(End(-1, BOTTOM, y_mm), SliceGrid(0.0, 0.95), lambda senses: []))
    vx, vy = pilot.step(Senses(1, 0.0, 0.0, (wall, wreck), (beside,)))
    along_wall = vx, min(vy, 0.0)
    assert along_wall[0] * wreck[0] + along_wall[1] * wreck[1] <= 1e-6
