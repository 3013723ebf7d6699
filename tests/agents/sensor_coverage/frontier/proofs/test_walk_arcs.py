"""Arcs that walks closed, and the slots on which they rely."""

from zwerm.agents.sensor_coverage.frontier.proofs.walk_arcs import WalkArcs
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc

WIDE, NARROW = Arc(1.0, 1.0), Arc(1.2, 0.5)
ALONE, WITH_ONE, WITH_TWO = ((), ()), ((1,), (2,)), ((1, 3), (2,))


def test_an_arc_counts_while_the_slots_stand_until_one_that_saw_the_walk_is_lost() -> None:
    arcs = WalkArcs()
    arcs.add(WITH_TWO, WIDE)
    assert list(arcs.counting((1, 3))) == [WIDE]
    assert list(arcs.counting((1,))) == []
    arcs.lose((2,))
    assert list(arcs.counting((1, 3))) == []


def test_an_arc_within_another_one_that_relies_on_less_is_dropped() -> None:
    for order in (((WITH_TWO, NARROW), (WITH_ONE, WIDE)), ((WITH_ONE, WIDE), (WITH_TWO, NARROW))):
        arcs = WalkArcs()
        for witnesses, arc in order:
            arcs.add(witnesses, arc)
        assert list(arcs.all()) == [(WITH_ONE, WIDE)]


def test_an_arc_that_relies_on_others_is_kept() -> None:
    arcs = WalkArcs()
    arcs.add(WITH_TWO, WIDE)
    arcs.add(WITH_ONE, NARROW)
    assert list(arcs.counting((1,))) == [NARROW]
    assert list(arcs.counting((1, 3))) == [WIDE, NARROW]
    assert arcs.unconditional() == []
    arcs.add(ALONE, WIDE)
    assert list(arcs.all()) == [(ALONE, WIDE)]
