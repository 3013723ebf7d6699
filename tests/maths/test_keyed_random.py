"""Keyed randomness: known answers, good statistics, and draws that depend on their key and on nothing else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from zwerm.maths.keyed_random import Draws, splitmix64, stream

GOLDEN_GAMMA = 0x9E3779B97F4A7C15
KNOWN_BITS = [1561070932040282131, 12085948253794388312, 8318024331926746034]
KNOWN_FIRST = 0.28564767209262454


def test_splitmix64_gives_the_reference_outputs() -> None:
    """The first outputs of the reference generator (Vigna, splitmix64.c) from state 0."""
    states = np.array([(step * GOLDEN_GAMMA) % 2**64 for step in range(3)], dtype=np.uint64)
    assert [hex(word) for word in splitmix64(states).tolist()] == [
        "0xe220a8397b1dcdaf",
        "0x6e789e6aa1b965f4",
        "0x6c45d188009454f",
    ]


def test_draws_are_the_same_on_every_machine_and_in_every_version() -> None:
    """A changed value here is a changed result of every run: it needs a changelog entry."""
    draws = Draws(1)
    assert draws.bits("probe", np.arange(3), 7).tolist() == KNOWN_BITS
    assert draws.uniform("probe", 0, 7).tolist() == KNOWN_BITS[0] // 2**11 / 2**53
    assert draws.generator("probe", 2).random() == KNOWN_FIRST


def test_a_draw_does_not_depend_on_what_was_drawn_before() -> None:
    fresh = Draws(5).uniform("sight", np.arange(10), 3)
    used = Draws(5)
    used.normal("sight", np.arange(100), 2)
    used.bits("drive", 1)
    assert (used.uniform("sight", np.arange(10), 3) == fresh).all()


def test_adding_a_robot_changes_no_other_robots_draws() -> None:
    draws = Draws(5)
    many = draws.normal("sight", np.arange(50), 3)
    assert (draws.normal("sight", np.arange(49), 3) == many[:49]).all()
    assert (draws.normal("sight", np.array([31, 4]), 3) == many[[31, 4]]).all()


def test_scalars_arrays_and_broadcast_ids_agree() -> None:
    draws = Draws(5)
    table = draws.uniform("link", np.arange(4)[:, None], np.arange(6), 9)
    assert table.shape == (4, 6)
    for sender in range(4):
        for receiver in range(6):
            alone = draws.uniform("link", sender, receiver, 9)
            assert np.shape(alone) == ()
            assert alone == table[sender, receiver]
    assert np.shape(draws.normal("link", 1, 2)) == ()
    assert np.shape(draws.normal("once")) == ()
    assert draws.bits("link", np.zeros(0, dtype=np.int64), 1).shape == (0,)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Draws(1).bits("a", np.arange(99), 3), Draws(2).bits("a", np.arange(99), 3)),
        (Draws(1).bits("a", np.arange(99), 3), Draws(1).bits("b", np.arange(99), 3)),
        (Draws(1).bits("a", np.arange(99), 3), Draws(1).bits("a", np.arange(99), 4)),
        (Draws(1).bits("a", np.arange(99), 3), Draws(1).bits("a", 3, np.arange(99))),
        (Draws(1).bits("a", np.arange(99)), Draws(1).bits("a", np.arange(99), 0)),
        (Draws(1).bits("a", 0, np.arange(99)), Draws(1).bits("a", np.arange(99), 0)),
    ],
    ids=["seed", "purpose", "sequence number", "order of the ids", "number of ids", "zeros"],
)
def test_another_key_is_another_draw(one: np.ndarray, other: np.ndarray) -> None:
    same = one == other
    assert same.sum() <= 1  # (3, 3) and (0, 0) are the same key in either order
    assert np.corrcoef(one.astype(np.float64), other.astype(np.float64))[0, 1] ** 2 * len(one) < 12.0


def test_no_two_keys_of_a_large_run_collide() -> None:
    words = Draws(3).bits("drive", np.arange(1000)[:, None], np.arange(1000))
    assert len(np.unique(words)) == words.size


# The statistical tests run at one seed: each either always passes or always fails. Their level is 1e-4, two-sided.
LEVEL = 1e-4


@pytest.mark.parametrize("axis", ["ids", "ticks"])
def test_uniform_draws_are_uniform(axis: str) -> None:
    count = np.arange(200_000)
    draws = Draws(11)
    values = draws.uniform("test", count, 4) if axis == "ids" else draws.uniform("test", 4, count)
    assert values.min() >= 0.0
    assert values.max() < 1.0
    observed = np.bincount((values * 256).astype(np.int64), minlength=256)
    assert LEVEL < stats.chisquare(observed).pvalue < 1.0 - LEVEL
    lowest_bits = draws.bits("test", count, 4) & np.uint64(255)
    assert LEVEL < stats.chisquare(np.bincount(lowest_bits.astype(np.int64), minlength=256)).pvalue < 1.0 - LEVEL


def test_neighbouring_ids_and_ticks_are_independent() -> None:
    table = Draws(12).uniform("test", np.arange(500)[:, None], np.arange(500))
    for near, far in ((table[:-1], table[1:]), (table[:, :-1], table[:, 1:]), (table[:-1, 1:], table[1:, :-1])):
        pairs, _, _ = np.histogram2d(near.ravel(), far.ravel(), bins=16, range=[[0, 1], [0, 1]])
        assert LEVEL < stats.chisquare(pairs.ravel()).pvalue < 1.0 - LEVEL


def test_normal_draws_are_standard_normal_and_independent_of_their_neighbours() -> None:
    values = Draws(13).normal("test", np.arange(200_000), 1)
    assert np.isfinite(values).all()
    assert stats.kstest(values, "norm").pvalue > LEVEL
    size = len(values)
    assert abs(values.mean()) < 4.0 / np.sqrt(size)
    assert abs(values.var() - 1.0) < 4.0 * np.sqrt(2.0 / size)
    assert abs(stats.skew(values)) < 4.0 * np.sqrt(6.0 / size)
    assert abs(stats.kurtosis(values)) < 4.0 * np.sqrt(24.0 / size)
    assert abs(np.corrcoef(values[:-1], values[1:])[0, 1]) < 4.0 / np.sqrt(size)
    assert np.abs(values).max() > 4.0


def test_ids_must_not_be_negative() -> None:
    with pytest.raises(OverflowError):
        Draws(1).bits("a", -1)


def test_a_stream_is_named_by_its_key_and_every_node_has_its_own() -> None:
    draws = Draws(7)
    key = draws.stream_key("controller", 3)
    assert len(key) == 16
    mine = stream(key).random(1000)
    assert (draws.generator("controller", 3).random(1000) == mine).all()
    for other in (draws.generator("controller", 4), draws.generator("place", 3), Draws(8).generator("controller", 3)):
        values = other.random(1000)
        assert (values != mine).all()
        assert abs(np.corrcoef(values, mine)[0, 1]) < 4.0 / np.sqrt(1000)


@given(seed=st.integers(0, 2**64), tick=st.integers(0, 2**40), ids=st.lists(st.integers(0, 2**40), max_size=20))
def test_few_draws_are_those_of_many(seed: int, tick: int, ids: list[int]) -> None:
    draws = Draws(seed)
    few = np.array(ids, dtype=np.int64)
    many = np.array([*ids, *range(40)], dtype=np.int64)
    for draw in (draws.bits, draws.uniform, draws.normal):
        assert (draw("purpose", tick, few) == draw("purpose", tick, many)[: len(ids)]).all()
        assert (draw("purpose", tick, few) == draw("purpose", np.full(len(ids), tick), few)).all()
