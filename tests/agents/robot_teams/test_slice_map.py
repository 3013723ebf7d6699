"""The map of ends, ports and mates: maps merge in any order, and the certificate names the open ends and ports."""

from itertools import permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.agents.robot_teams.mapping.facts import (
    BOTTOM,
    CONCAVE,
    CONVEX,
    LEFT,
    PASSES,
    RIGHT,
    TOP,
    End,
    Fact,
    SweptSegment,
    TracedArc,
    Void,
    Wreck,
)
from zwerm.agents.robot_teams.mapping.slice_map import TOLERANCE_MM, SliceMap

ENDS = st.builds(End, st.integers(-3, 3), st.sampled_from([TOP, BOTTOM]), st.integers(0, 2_000))
SEGMENTS = st.builds(SweptSegment, st.integers(-3, 3), st.integers(0, 1_000), st.integers(1_001, 2_000))
ARCS = st.builds(TracedArc, ENDS, st.sampled_from([LEFT, RIGHT]), ENDS, st.integers(1, 3_000), st.just(0), st.just(0))
FACTS = st.lists(st.one_of(SEGMENTS, ARCS), max_size=12)


def arc(start: End, direction: int, stop: End, length_mm: int = 950) -> TracedArc:
    return TracedArc(start, direction, stop, length_mm, 0, 0)


def known(facts: list[Fact]) -> SliceMap:
    slice_map = SliceMap()
    slice_map.merge(facts)
    return slice_map


def summary(slice_map: SliceMap) -> object:
    ends = sorted({end for fact in slice_map.facts.arcs for end in (fact.start, fact.stop)})
    return slice_map.certificate, slice_map.facts.digest, [slice_map.end(end) for end in ends]


def room(slices: int) -> list[Fact]:
    """Return the facts of an empty rectangular room that `slices` slices cross."""
    facts: list[Fact] = [SweptSegment(k, 0, 5_000) for k in range(slices)]
    for k in range(slices - 1):
        facts += [arc(End(k, side, y), RIGHT, End(k + 1, side, y)) for side, y in ((TOP, 5_000), (BOTTOM, 0))]
    facts.append(arc(End(0, TOP, 5_000), LEFT, End(0, BOTTOM, 0), 5_500))
    last = slices - 1
    facts.append(arc(End(last, TOP, 5_000), RIGHT, End(last, BOTTOM, 0), 5_500))
    return facts


@settings(deadline=None)
@given(FACTS, FACTS)
def test_merging_is_commutative(one: list[Fact], other: list[Fact]) -> None:
    assert summary(known([*one, *other])) == summary(known([*other, *one]))


@settings(deadline=None)
@given(FACTS, FACTS, FACTS)
def test_merging_is_associative(a: list[Fact], b: list[Fact], c: list[Fact]) -> None:
    left = known(known([*a, *b]).facts.since(0) + c)
    right = known(a + known([*b, *c]).facts.since(0))
    assert summary(left) == summary(right)


@settings(deadline=None)
@given(FACTS)
def test_merging_is_idempotent(facts: list[Fact]) -> None:
    slice_map = known(facts)
    before = summary(slice_map)
    assert slice_map.merge(facts) == 0
    assert summary(slice_map) == before


@settings(deadline=None)
@given(FACTS, st.randoms(use_true_random=False))
def test_the_order_of_facts_has_no_influence(facts: list[Fact], random: object) -> None:
    shuffled = list(facts)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    assert summary(known(facts)) == summary(known(shuffled))


def test_different_sets_have_different_digests() -> None:
    sets: list[list[Fact]] = [[], [SweptSegment(0, 0, 1)], [SweptSegment(0, 0, 2)], [SweptSegment(1, 0, 1)]]
    digests = {known(facts).facts.digest for facts in sets}
    assert len(digests) == 4


@pytest.mark.parametrize("slices", [1, 2, 5])
def test_a_room_is_complete_only_with_every_one_of_its_facts(slices: int) -> None:
    facts = room(slices)
    assert known(facts).certificate.complete
    for missing in range(len(facts)):
        assert not known(facts[:missing] + facts[missing + 1 :]).certificate.complete


def test_nothing_known_is_not_complete() -> None:
    assert not SliceMap().certificate.complete


def test_the_certificate_names_what_is_open() -> None:
    end, mate = End(0, TOP, 5_000), End(0, BOTTOM, 0)
    slice_map = known([arc(end, RIGHT, End(1, TOP, 5_010))])
    certificate = slice_map.certificate
    assert certificate.ends_without_mate == (end, End(1, TOP, 5_010))
    assert certificate.open_ports == ((end, LEFT), (End(1, TOP, 5_010), RIGHT))
    slice_map.add(SweptSegment(0, 0, 5_000))
    assert slice_map.certificate.ends_without_mate == (End(1, TOP, 5_010),)
    assert (mate, LEFT) in slice_map.certificate.open_ports


def test_two_measurements_of_an_end_are_one_end() -> None:
    near = End(0, TOP, 5_000 + TOLERANCE_MM)
    slice_map = known([SweptSegment(0, 0, 5_000), arc(near, RIGHT, End(1, TOP, 5_000))])
    assert slice_map.end(near) == slice_map.end(End(0, TOP, 5_000)) == End(0, TOP, 5_000)
    assert slice_map.certificate.ends == 3
    far = known([SweptSegment(0, 0, 5_000), arc(End(0, TOP, 5_001 + TOLERANCE_MM), RIGHT, End(1, TOP, 5_000))])
    assert far.certificate.ends == 4


@pytest.mark.parametrize(
    ("start", "stop", "kind"),
    [
        (End(0, TOP, 1_000), End(1, TOP, 1_000), PASSES),
        (End(0, TOP, 1_000), End(0, BOTTOM, 1_800), CONVEX),
        (End(0, TOP, 1_000), End(0, BOTTOM, 200), CONCAVE),
        (End(0, BOTTOM, 1_000), End(0, TOP, 200), CONVEX),
        (End(0, BOTTOM, 1_000), End(0, TOP, 1_800), CONCAVE),
    ],
)
def test_an_arc_that_returns_is_a_critical_point(start: End, stop: End, kind: int) -> None:
    assert arc(start, RIGHT, stop).kind == kind


def test_an_arc_closes_a_port_at_both_of_its_ends() -> None:
    passing = arc(End(0, TOP, 0), RIGHT, End(1, TOP, 0))
    assert passing.ports == ((End(0, TOP, 0), RIGHT), (End(1, TOP, 0), LEFT))
    returning = arc(End(0, TOP, 900), RIGHT, End(0, BOTTOM, 0))
    assert returning.ports == ((End(0, TOP, 900), RIGHT), (End(0, BOTTOM, 0), RIGHT))


def test_the_route_is_the_shortest_for_every_order_of_the_facts() -> None:
    facts = room(4)
    start, stop = End(0, BOTTOM, 0), End(3, TOP, 5_000)
    routes = []
    for order in list(permutations(range(len(facts)), 3))[::40]:
        shuffled = [facts[i] for i in order] + [fact for i, fact in enumerate(facts) if i not in order]
        route = known(shuffled).route(start, stop)
        assert route is not None
        routes.append(route)
    assert all(sum(step.length_mm for _, step in route) == 5_000 + 3 * 950 for route in routes)
    assert all(route == routes[0] for route in routes)


def test_there_is_no_route_to_where_nothing_leads() -> None:
    slice_map = known([SweptSegment(0, 0, 1_000), SweptSegment(5, 0, 1_000)])
    assert slice_map.route(End(0, TOP, 1_000), End(5, TOP, 1_000)) is None
    assert End(5, TOP, 1_000) not in slice_map.distances(End(0, TOP, 1_000))


def test_an_area_behind_a_dead_robot_is_not_open() -> None:
    facts: list[Fact] = [
        fact for fact in room(3) if not isinstance(fact, TracedArc) or End(1, TOP, 5_000) not in fact[:3]
    ]
    assert not known(facts).certificate.complete
    hidden = known([*facts, Void(1, 950, 4_600, 5_400, Wreck(3, 100))]).certificate
    assert all(end != End(1, TOP, 5_000) for end, _ in hidden.open_ports)
    assert hidden.open_ports == ((End(0, TOP, 5_000), RIGHT), (End(2, TOP, 5_000), LEFT))


def test_a_swept_slice_is_known_by_height() -> None:
    slice_map = known([SweptSegment(2, 1_000, 3_000)])
    assert slice_map.is_swept(2, 2_000)
    assert not slice_map.is_swept(2, 6_000)
    assert not slice_map.is_swept(3, 2_000)
