"""The trace: equal runs have equal traces, and every difference between two runs changes the trace."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zwerm.wire.messages import Command, Observation, WheelSpeeds, encode
from zwerm.wire.trace import Trace

Tick = tuple[int, list[int], list[bytes], list[bytes]]


def trace_of(ticks: Sequence[Tick], scenario: bytes = b"") -> str:
    trace = Trace(scenario)
    for tick in ticks:
        trace.extend(*tick)
    return trace.hex()


RUN: list[Tick] = [(0, [0, 1, 5], [b"o0", b"o1", b"o5"], [b"c0", b"", b"c5"]), (1, [1], [b"o1'"], [b"c1'"])]


def test_a_known_run_has_its_known_trace() -> None:
    assert trace_of(RUN) == trace_of(RUN) == "3ee39c4a5efa73da66a6c6286a1f4b37"


@pytest.mark.parametrize(
    "changed",
    [
        [],
        RUN[:1],
        [RUN[1], RUN[0]],
        [*RUN, (2, [], [], [])],
        [(0, [0, 1, 5], [b"o1", b"o0", b"o5"], [b"c0", b"", b"c5"]), RUN[1]],
        [(0, [1, 0, 5], [b"o0", b"o1", b"o5"], [b"c0", b"", b"c5"]), RUN[1]],
        [(0, [0, 1, 4], [b"o0", b"o1", b"o5"], [b"c0", b"", b"c5"]), RUN[1]],
        [(3, [0, 1, 5], [b"o0", b"o1", b"o5"], [b"c0", b"", b"c5"]), RUN[1]],
        [(0, [0, 1, 5], [b"o0", b"o1", b"o5"], [b"", b"c0", b"c5"]), RUN[1]],
        [(0, [0, 1, 5], [b"o0", b"o1", b"o5"], [b"c0", b"c5", b""]), RUN[1]],
        [(0, [0, 1, 5], [b"o0", b"o1", b"o5c0"], [b"", b"", b"c5"]), RUN[1]],
        [(0, [0, 1, 5], [b"o0o1", b"", b"o5"], [b"c0", b"", b"c5"]), RUN[1]],
    ],
    ids=[
        "nothing",
        "a tick less",
        "ticks swapped",
        "a tick more",
        "observations swapped",
        "ids swapped",
        "another id",
        "another tick",
        "another node silent",
        "command moved to a silent node",
        "bytes moved from a command to an observation",
        "bytes moved between observations",
    ],
)
def test_any_difference_between_two_runs_changes_the_trace(changed: list[Tick]) -> None:
    assert trace_of(changed) != trace_of(RUN)


def test_another_scenario_is_another_trace() -> None:
    assert trace_of(RUN, b"one") != trace_of(RUN, b"two")


def test_one_bit_anywhere_changes_the_trace() -> None:
    observation = encode(Observation(3, 0.3, line_of_sight=True))
    command = encode(Command(3, WheelSpeeds(0.1, -0.1)))
    before = trace_of([(3, [7], [observation], [command])])
    both = observation + command
    for bit in range(8 * len(both)):
        bent = bytearray(both)
        bent[bit // 8] ^= 1 << bit % 8
        split = len(observation)
        assert trace_of([(3, [7], [bytes(bent[:split])], [bytes(bent[split:])])]) != before


payloads = st.binary(max_size=3)


@st.composite
def ticks(draw: st.DrawFn) -> Tick:
    nodes = sorted(draw(st.sets(st.integers(0, 3), max_size=3)))
    some = st.lists(payloads, min_size=len(nodes), max_size=len(nodes))
    return draw(st.integers(0, 2)), nodes, draw(some), draw(some)


@given(st.lists(ticks(), max_size=2), st.lists(ticks(), max_size=2))
def test_two_runs_have_the_same_trace_only_if_they_are_the_same_run(one: list[Tick], other: list[Tick]) -> None:
    assert (trace_of(one) == trace_of(other)) == (one == other)
