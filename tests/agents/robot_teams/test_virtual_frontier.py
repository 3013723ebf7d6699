"""The virtual frontier: sweeps end at it, the space beyond it stays open, and a later sweep past it makes it void."""

from zwerm.agents.robot_teams.mapping.facts import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    End,
    Fact,
    FrontierCut,
    SweptSegment,
    TracedArc,
)
from zwerm.agents.robot_teams.mapping.slice_map import ACROSS, SliceMap
from zwerm.agents.robot_teams.planning import Task, open_tasks, room
from zwerm.agents.robot_teams.protocols.team_messages import CorridorPlan
from zwerm.agents.robot_teams.virtual_frontier import Frontier, TeamFrontier

LINE_MM = 2_000
LOWER, UPPER = FrontierCut(1, LINE_MM).ends


def arc(start: End, direction: int, stop: End) -> TracedArc:
    return TracedArc(start, direction, stop, 950, 0, 0)


def walls() -> list[Fact]:
    """Return the arcs of a rectangular room of two slices."""
    found: list[Fact] = [arc(End(0, side, y), RIGHT, End(1, side, y)) for side, y in ((TOP, 5_000), (BOTTOM, 0))]
    found.append(arc(End(0, TOP, 5_000), LEFT, End(0, BOTTOM, 0)))
    return [*found, arc(End(1, TOP, 5_000), RIGHT, End(1, BOTTOM, 0))]


def known(*facts: Fact) -> SliceMap:
    slice_map = SliceMap()
    slice_map.merge(facts)
    return slice_map


def test_what_a_frontier_leaves_lacks_a_mate_and_has_no_ports() -> None:
    slice_map = known(*walls(), SweptSegment(0, 0, 5_000), SweptSegment(1, LINE_MM, 5_000), FrontierCut(1, LINE_MM))
    certificate = slice_map.certificate
    assert certificate.ends_without_mate == (End(1, BOTTOM, 0), LOWER)
    assert certificate.open_ports == ()
    assert Task(LOWER, RIGHT, True) in open_tasks(slice_map)
    assert room(slice_map, Task(LOWER, RIGHT, True), 4) == 1


def test_both_parts_swept_are_complete_and_so_is_a_sweep_past_the_frontier() -> None:
    cut: list[Fact] = [*walls(), SweptSegment(0, 0, 5_000), SweptSegment(1, LINE_MM, 5_000), FrontierCut(1, LINE_MM)]
    assert known(*cut, SweptSegment(1, 0, LINE_MM)).certificate.complete
    assert known(*cut, SweptSegment(1, 0, 5_000)).certificate.complete
    assert not known(*cut).certificate.complete


def test_a_way_leads_across_the_frontier() -> None:
    slice_map = known(SweptSegment(1, LINE_MM, 5_000), SweptSegment(1, 0, LINE_MM), FrontierCut(1, LINE_MM))
    route = slice_map.route(End(1, TOP, 5_000), End(1, BOTTOM, 0))
    assert route is not None
    assert [step.direction for _, step in route] == [0, ACROSS, 0]


def test_an_end_of_the_boundary_at_the_frontier_keeps_its_ports() -> None:
    """The floor lies a little below the line: the ends there were measured as one, and the boundary counts."""
    floor = End(1, BOTTOM, LINE_MM - 50)
    slice_map = known(
        SweptSegment(1, LINE_MM, 5_000), FrontierCut(1, LINE_MM), arc(floor, RIGHT, End(2, BOTTOM, LINE_MM))
    )
    assert not slice_map.is_virtual(floor)
    assert (floor, LEFT) in slice_map.certificate.open_ports


# --- the lead's frontier ----------------------------------------------------------------------------------------------

TIP = TracedArc(End(3, BOTTOM, 3_000), RIGHT, End(3, TOP, 1_000), 2_500, 3_200, LINE_MM)


def plan(first: int, count: int = 2, direction: int = RIGHT, y_mm: int = 5_000) -> CorridorPlan:
    return CorridorPlan(2, 1, End(first, TOP, y_mm), direction, True, tuple(range(count)))


def test_a_forward_convex_critical_point_begins_a_frontier_for_later_corridors() -> None:
    frontiers = TeamFrontier(known(TIP))
    assert frontiers.limited(plan(4)).frontier_mm is None
    frontiers.judge(plan(2))
    assert frontiers.frontier == Frontier(LINE_MM, 4, RIGHT)
    assert frontiers.limited(plan(4)).frontier_mm == LINE_MM
    assert frontiers.limited(plan(3)).frontier_mm is None
    assert frontiers.limited(plan(4, direction=LEFT)).frontier_mm is None
    assert frontiers.limited(plan(4, y_mm=LINE_MM + 100)).frontier_mm is None


def test_a_reverse_or_concave_critical_point_begins_none() -> None:
    concave = TracedArc(End(3, TOP, 3_000), RIGHT, End(3, BOTTOM, 1_000), 2_500, 3_200, LINE_MM)
    for facts in ((concave,), (TIP._replace(direction=LEFT),)):
        frontiers = TeamFrontier(known(*facts))
        frontiers.judge(plan(2))
        assert frontiers.frontier is None


def test_a_frontier_ends_at_the_first_slice_that_an_obstacle_cuts_off() -> None:
    slice_map = known(TIP)
    frontiers = TeamFrontier(slice_map)
    frontiers.judge(plan(2))
    corridor = frontiers.limited(plan(4))
    slice_map.merge(
        [
            SweptSegment(4, LINE_MM, 5_000),
            FrontierCut(4, LINE_MM),
            SweptSegment(5, LINE_MM, 5_000),
            FrontierCut(5, LINE_MM),
        ]
    )
    frontiers.judge(corridor)
    assert frontiers.frontier is not None
    assert frontiers.is_reserved(FrontierCut(4, LINE_MM).ends[0])
    slice_map.merge([SweptSegment(6, 3_500, 5_000)])
    frontiers.judge(frontiers.limited(plan(6, count=1)))
    assert frontiers.frontier is None
    assert not frontiers.is_reserved(FrontierCut(4, LINE_MM).ends[0])
