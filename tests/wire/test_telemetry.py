"""The rule for telemetry on the wire, on the node's side and on the world's."""

import math

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zwerm.errors import ProtocolError
from zwerm.wire.messages import Command, encode, encode_command, open_answer, traced_bytes
from zwerm.wire.telemetry_rules import NAMES_MAX, is_telemetry_name, plain_numbers, telemetry_error

LONG = "a" * 65


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"complex": {}}, "telemetry.complex: expected a number, got {}"),
        ({"cycles": "many"}, "telemetry.cycles: expected a number, got 'many'"),
        ({"cycles": b"3"}, "telemetry.cycles: expected a number, got b'3'"),
        ({"cycles": None}, "telemetry.cycles: expected a number, got None"),
        ({"cycles": np.ones(1)}, "telemetry.cycles: expected a number, got array([1.])"),
        ({"x": math.nan}, "telemetry.x: expected a finite number, got nan"),
        ({"x": -math.inf}, "telemetry.x: expected a finite number, got -inf"),
        ({"X": 1.0}, "telemetry: expected a name of [a-z][a-z0-9_]*, at most 64 characters, got 'X'"),
        ({"x\n": 1.0}, "telemetry: expected a name of [a-z][a-z0-9_]*, at most 64 characters, got 'x\\n'"),
        ({7: 1.0}, "telemetry: expected a name of [a-z][a-z0-9_]*, at most 64 characters, got 7"),
        ({LONG: 1.0}, f"telemetry: expected a name of [a-z][a-z0-9_]*, at most 64 characters, got '{LONG}'"),
        ({f"n{n}": 1.0 for n in range(65)}, "telemetry: expected at most 64 names, got 65"),
        ([1.0], "telemetry: expected a dict of numbers by name, got [1.0]"),
    ],
)
def test_invalid_telemetry_is_refused_at_the_node_with_rule_name_and_value(given: object, line: str) -> None:
    with pytest.raises((TypeError, ValueError)) as caught:
        encode_command(Command(telemetry=given))  # type: ignore[arg-type]
    assert str(caught.value) == line


def test_a_snapshot_that_is_no_bytes_is_refused_at_the_node() -> None:
    with pytest.raises(TypeError, match=r"^snapshot: expected bytes, got dict$"):
        encode_command(Command(snapshot={"complex": 1}))  # type: ignore[arg-type]


def test_integers_booleans_and_numpy_scalars_cross_the_wire_as_floats() -> None:
    numbers = {"int": 3, "bool": True, "np_int": np.int32(7), "np_float": np.float64(0.25), "np_bool": np.True_}
    payload = encode_command(Command(telemetry=numbers))  # type: ignore[arg-type]
    assert msgpack.unpackb(payload)["telemetry"] == {
        "int": 3.0, "bool": 1.0, "np_int": 7.0, "np_float": 0.25, "np_bool": 1.0,
    }  # fmt: skip
    answer = open_answer(payload)
    assert isinstance(answer, Command)
    assert all(type(value) is float for value in answer.telemetry.values())


@pytest.mark.parametrize(
    "telemetry",
    [{"complex": {}}, {"x": "many"}, {"x": None}, {"x": math.nan}, {"X": 1.0}, {f"n{n}": 1 for n in range(65)}, [1.0]],
)
def test_forged_telemetry_is_refused_by_the_world_for_that_reason(telemetry: object) -> None:
    forged = msgpack.packb({"type": "command/1", "telemetry": telemetry})
    with pytest.raises(ProtocolError) as caught:
        open_answer(forged)
    assert caught.value.reason == "telemetry"


@pytest.mark.parametrize(("digits", "shown"), [(400, "1000"), (5_000, "a int")])
def test_an_integer_that_is_no_float_is_named(digits: int, shown: str) -> None:
    with pytest.raises(ValueError, match=rf"telemetry\.x: expected a finite number, got {shown}"):
        plain_numbers({"x": 10**digits})


def test_integers_and_booleans_of_a_node_in_another_language_are_numbers() -> None:
    answer = open_answer(msgpack.packb({"type": "command/1", "telemetry": {"a": 3, "b": True}}))
    assert isinstance(answer, Command)
    assert answer.telemetry == {"a": 3.0, "b": 1.0}


def test_a_command_without_telemetry_has_the_bytes_it_had_before() -> None:
    assert msgpack.unpackb(encode(Command(tick=3))) == {"type": "command/1", "tick": 3}


def test_the_traced_bytes_are_those_of_the_command_without_telemetry_and_snapshot() -> None:
    bare = Command(tick=3, release=True, gave_up="no way")
    reporting = Command(tick=3, release=True, gave_up="no way", telemetry={"x": 1.0}, snapshot=b"s")
    assert traced_bytes(reporting, encode(reporting)) == encode(bare)
    payload = encode(bare)
    assert traced_bytes(bare, payload) is payload
    assert encode(reporting) != encode(bare)


@given(st.dictionaries(st.text(max_size=70), st.floats() | st.integers() | st.booleans(), max_size=70))
def test_telemetry_is_accepted_exactly_where_every_name_and_number_keeps_the_rule(numbers: dict[str, float]) -> None:
    def fits(value: float) -> bool:
        try:
            return math.isfinite(float(value))
        except OverflowError:
            return False

    proper = len(numbers) <= NAMES_MAX and all(is_telemetry_name(n) and fits(v) for n, v in numbers.items())
    try:
        found = plain_numbers(numbers)
    except ValueError:
        assert not proper
    else:
        assert proper
        assert telemetry_error(found) == ""
