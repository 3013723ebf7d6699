"""Cost-utility: the search that stops early finds what an exhaustive one does."""

import math
from collections.abc import Sequence

from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.cost_utility import Offer, cost_utility, nearest_frontier, reach
from zwerm.agents.landmark_exploration.mapping.frontier_status import UNEXPLORED, Frontiers, key_of, pair_of
from zwerm.agents.landmark_exploration.mapping.guided_search import GuidedSearch, PivotCosts
from zwerm.agents.landmark_exploration.mapping.landmark_complex import LandmarkComplex

LANDMARKS = 9
observed = st.lists(st.frozensets(st.integers(0, LANDMARKS), min_size=1, max_size=5), min_size=1, max_size=12)
pairs = st.lists(
    st.tuples(st.integers(0, LANDMARKS), st.integers(0, LANDMARKS)).filter(lambda pair: pair[0] != pair[1]),
    max_size=14,
    unique=True,
)


def made(some: Sequence[frozenset[int]], open_: Sequence[tuple[int, int]]) -> tuple[LandmarkComplex, Frontiers]:
    complex_, frontiers = LandmarkComplex(), Frontiers()
    for each in some:
        complex_.update(BearingSnapshot(tuple(sorted(each)), (0,) * len(each)))
    for pair in open_:
        frontiers.raise_to(key_of(*pair), UNEXPLORED)
    return complex_, frontiers


def costs(complex_: LandmarkComplex, here: frozenset[int]) -> dict[int, float]:
    """Return the cost of every vertex, by relaxing all edges until nothing changes (Bellman and Ford)."""
    names = {vertex: frozenset(each) for vertex, each in complex_.simplices.items()}
    cost = {v: 1.0 / (len(here & s) - 1) if len(here & s) >= 2 else math.inf for v, s in names.items()}
    for _ in names:
        for v, s in names.items():
            for w, t in names.items():
                if v != w and len(s & t) >= 2:
                    cost[w] = min(cost[w], cost[v] + 1.0 / (len(s & t) - 1))
    return cost


@settings(deadline=None)
@given(observed, pairs, pairs, st.frozensets(st.integers(0, LANDMARKS), min_size=1, max_size=4), st.floats(0.0, 20.0))
def test_the_choice_is_the_best_of_all(
    some: list[frozenset[int]],
    open_: list[tuple[int, int]],
    taken: list[tuple[int, int]],
    here: frozenset[int],
    beta: float,
) -> None:
    complex_, frontiers = made(some, open_)
    offer = Offer(frontiers, [key_of(*pair) for pair in taken])
    cost = costs(complex_, here)
    gains: dict[tuple[int, int], float] = {}
    for a, b in open_:
        if (a, b) in taken:
            continue
        near = [0.0] if {a, b} <= here else []
        near += [cost[v] for v, s in complex_.simplices.items() if {a, b} <= set(s)]
        sharing = sum(bool({a, b} & {c, d}) for c, d in open_)
        robots = sum(bool({a, b} & {c, d}) for c, d in taken)
        if near and min(near) < math.inf:
            gains[a, b] = sharing / (1 + robots) - beta * min(near)
    choice = cost_utility(beta)(complex_, tuple(here), offer)
    if choice is None:
        assert not gains
        return
    assert math.isclose(choice.gain, max(gains.values()), abs_tol=1e-9)
    assert math.isclose(choice.gain, gains[pair_of(choice.key)], abs_tol=1e-9)
    seen = here
    for vertex in choice.path:
        assert len(seen & set(complex_.simplices[vertex])) >= 2
        seen = frozenset(complex_.simplices[vertex])
    assert set(pair_of(choice.key)) <= seen


@settings(deadline=None)
@given(observed, st.frozensets(st.integers(0, LANDMARKS), max_size=4))
def test_reach_yields_every_cost_in_order(some: list[frozenset[int]], here: frozenset[int]) -> None:
    complex_, _ = made(some, [])
    found = list(reach(complex_, tuple(here)))
    expected = {vertex: cost for vertex, cost in costs(complex_, here).items() if cost < math.inf}
    assert {each.vertex for each in found} == set(expected)
    assert all(math.isclose(each.cost, expected[each.vertex]) for each in found)
    assert [each.cost for each in found] == sorted(each.cost for each in found)


def test_the_nearest_frontier_is_preferred_to_the_most_useful_one() -> None:
    useful = [(5, 6), (6, 5), (5, 7), (7, 5), (6, 7), (7, 6)]
    complex_, frontiers = made([frozenset({1, 2, 3}), frozenset({2, 3, 5}), frozenset({3, 5, 6, 7})], [(1, 2), *useful])
    offer = Offer(frontiers, [])
    near = nearest_frontier(complex_, (1, 2, 3), offer)
    assert near is not None
    assert pair_of(near.key) == (1, 2)
    # Without any cost the most useful one is best.
    far = cost_utility(0.0)(complex_, (1, 2, 3), offer)
    assert far is not None
    assert pair_of(far.key) in useful
    assert far.path


def test_avoided_frontiers_are_not_chosen() -> None:
    complex_, frontiers = made([frozenset({1, 2})], [(1, 2)])
    assert cost_utility(1.0)(complex_, (1, 2), Offer(frontiers, [], {key_of(1, 2): None})) is None


@settings(deadline=None)
@given(
    st.lists(st.frozensets(st.integers(0, 14), min_size=1, max_size=5), min_size=1, max_size=24),
    st.integers(0, 24),
    pairs,
    pairs,
    st.lists(st.frozensets(st.integers(0, 14), max_size=4), min_size=1, max_size=3),
    st.floats(0.01, 20.0),
)
def test_a_guided_search_makes_the_same_choices(
    some: list[frozenset[int]],
    before: int,
    open_: list[tuple[int, int]],
    taken: list[tuple[int, int]],
    places: list[frozenset[int]],
    beta: float,
) -> None:
    complex_, frontiers = made(some[:before], open_)
    costs = PivotCosts(complex_)
    costs.update()
    for number, each in enumerate(some[before:]):  # pivots are chosen for a part of the map, which then grows
        complex_.update(BearingSnapshot(tuple(sorted(each)), (0,) * len(each)))
        if number % 3 == 0:
            costs.update()
    offer = Offer(frontiers, [key_of(*pair) for pair in taken])
    keys = offer.free_keys(len(open_))
    assert keys == sorted({key_of(*pair) for pair in open_} - {key_of(*pair) for pair in taken})
    guide = GuidedSearch(complex_, costs, offer, keys, beta)
    while keys:
        chosen = None
        for place in places:
            here = tuple(sorted(place))
            choice = cost_utility(beta)(complex_, here, offer)
            assert guide.best(here) == choice
            bound = guide.bound(here)
            if bound is not None and choice is not None:
                assert choice.gain <= bound
            chosen = choice or chosen
        if chosen is None:
            break
        offer.take(chosen.key)
        guide.take(chosen.key)
        keys.remove(chosen.key)


@settings(deadline=None)
@given(st.lists(st.frozensets(st.integers(0, 20), min_size=2, max_size=5), min_size=2, max_size=30))
def test_costs_from_pivots_are_exact_while_the_map_grows(some: list[frozenset[int]]) -> None:
    complex_, _ = made(some[:1], [])
    grown = PivotCosts(complex_)
    grown.update()
    for each in some[1:]:
        complex_.update(BearingSnapshot(tuple(sorted(each)), (0,) * len(each)))
        grown.update()
    for pivot, known in zip(grown.pivots, grown.costs, strict=True):
        exact = {each.vertex: each.cost for each in reach(complex_, pivot)}
        for vertex in complex_.simplices:
            assert math.isclose(known[vertex], exact.get(vertex, math.inf))
