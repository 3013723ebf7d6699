"""Refused messages are counted once, by node and by reason."""

from zwerm.wire.refusals import Refusals


def test_refusals_are_counted_by_node_and_their_sum_by_reason() -> None:
    refusals = Refusals()
    assert (refusals.of_node(2), refusals.by_node, refusals.by_reason) == (0, {}, {})
    assert [refusals.count(2, "malformed"), refusals.count(0, "duplicate"), refusals.count(2, "duplicate")] == [1, 1, 2]
    assert refusals.by_node == {0: {"duplicate": 1}, 2: {"malformed": 1, "duplicate": 1}}
    assert list(refusals.by_node) == [0, 2]
    assert refusals.by_reason == {"malformed": 1, "duplicate": 2}
    assert refusals.of_node(2) == 2


def test_the_sum_of_two_counts_changes_neither() -> None:
    link, world = Refusals(), Refusals()
    link.count(1, "not-joined")
    world.count(1, "not-joined")
    world.count(3, "telemetry")
    both = link | world
    assert both.by_node == {1: {"not-joined": 2}, 3: {"telemetry": 1}}
    assert link.by_node == {1: {"not-joined": 1}}
    assert world.by_reason == {"not-joined": 1, "telemetry": 1}
