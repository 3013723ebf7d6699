"""The wire: messages survive encoding, other languages can join, and every wrong message is refused with a reason."""

import math
import random
from contextlib import suppress
from typing import Any

import msgpack
import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.errors import ProtocolError
from zwerm.wire.messages import (
    MESSAGE_BYTES_MAX,
    REFUSABLE,
    SENSOR_FIELDS,
    Bearing,
    BodyVelocity,
    Command,
    Contact,
    Displacement,
    Failure,
    FieldSample,
    Goodbye,
    Hello,
    LandmarkBearing,
    Neighbour,
    Observation,
    Packet,
    Pose,
    Transmission,
    Wake,
    Welcome,
    WheelSpeeds,
    decode_answer,
    decode_hello,
    decode_observation,
    decode_to_node,
    decode_welcome,
    encode,
    open_answer,
)

# --- every message that can be made ---------------------------------------------------------------------------------

numbers = st.floats(allow_nan=False)
finite = st.floats(-1e100, 1e100)
ids = st.integers(0, 2**63 - 1)
words = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)


def many(part: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.none() | st.lists(part, max_size=3).map(tuple)


packets = st.builds(Packet, words, st.binary(max_size=8), st.none() | ids)
observations = st.builds(
    Observation,
    tick=ids,
    time_s=numbers,
    inbox=st.lists(packets, max_size=3).map(tuple),
    line_of_sight=st.none() | st.booleans(),
    bearings=many(st.builds(Bearing, ids, numbers)),
    touch=many(st.builds(Contact, numbers, numbers)),
    landmarks=many(st.builds(LandmarkBearing, ids, numbers)),
    neighbours=many(st.builds(Neighbour, ids, numbers, numbers)),
    field=st.none() | st.builds(FieldSample, numbers, numbers, numbers),
    pose=st.none() | st.builds(Pose, numbers, numbers, numbers),
    boundary=many(st.tuples(numbers, numbers)),
    odometry=st.none() | st.builds(Displacement, numbers, numbers, numbers),
    compass_rad=st.none() | numbers,
    extra=st.none() | st.dictionaries(words, st.lists(numbers, max_size=2).map(tuple), max_size=2),
)
drives = st.builds(BodyVelocity, finite, finite, finite) | st.builds(WheelSpeeds, finite, finite)
commands = st.builds(
    Command,
    tick=ids,
    drive=st.none() | drives,
    outbox=st.lists(st.builds(Transmission, words, st.binary(max_size=8), st.none() | ids), max_size=3).map(tuple),
    wake=st.none() | st.builds(Wake, st.none() | finite, st.booleans(), st.booleans(), st.booleans()),
    release=st.booleans(),
    done=st.booleans(),
)
failures = st.builds(Failure, ids, words, words)


@given(observations)
def test_an_observation_survives_the_wire(observation: Observation) -> None:
    assert decode_observation(encode(observation)) == observation
    assert decode_to_node(encode(observation)) == observation


@given(commands | failures)
def test_an_answer_survives_the_wire(answer: Command | Failure) -> None:
    assert open_answer(encode(answer)) == answer


@given(commands)
def test_equal_commands_have_equal_bytes(command: Command) -> None:
    again = decode_answer(encode(command))
    assert again == command
    assert encode(again) == encode(command)


@given(st.builds(Hello, ids, ids) | st.builds(Goodbye, words))
def test_greetings_survive_the_wire(greeting: Hello | Goodbye) -> None:
    assert decode_hello(encode(greeting)) == greeting


def test_a_welcome_carries_the_setup_as_it_is() -> None:
    setup = {"node": 3, "stream_key": b"\x00\xff", "parameters": {"gain": 1.5}}
    welcome = decode_welcome(encode(Welcome(controller="mine:Mine", setup=msgspec.Raw(encode(setup)))))
    assert (welcome.refused, welcome.controller) == ("", "mine:Mine")
    assert msgspec.msgpack.decode(welcome.setup) == setup


# --- other languages ------------------------------------------------------------------------------------------------

WIRE: list[tuple[msgspec.Struct, dict[str, Any]]] = [
    (Observation(0, 0.0), {"type": "observation/1", "tick": 0, "time_s": 0.0}),
    (
        Observation(
            3,
            0.25,
            inbox=(Packet("news", b"\x00\x01"), Packet("news", b"", 7)),
            line_of_sight=False,
            bearings=(Bearing(4, -0.5),),
            touch=(),
            landmarks=(LandmarkBearing(1, 0.5),),
            neighbours=(Neighbour(2, 1.0, -1.0),),
            field=FieldSample(0.5, 1.0, -1.0),
            pose=Pose(1.0, 2.0, 3.0),
            boundary=((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)),
            odometry=Displacement(0.125, 0.0, 0.5),
            compass_rad=0.0,
            extra={"sonar": (1.0, 2.0)},
        ),
        {
            "type": "observation/1",
            "tick": 3,
            "time_s": 0.25,
            "inbox": [["news", b"\x00\x01", None], ["news", b"", 7]],
            "line_of_sight": False,
            "bearings": [[4, -0.5]],
            "touch": [],
            "landmarks": [[1, 0.5]],
            "neighbours": [[2, 1.0, -1.0]],
            "field": [0.5, 1.0, -1.0],
            "pose": [1.0, 2.0, 3.0],
            "boundary": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            "odometry": [0.125, 0.0, 0.5],
            "compass_rad": 0.0,
            "extra": {"sonar": [1.0, 2.0]},
        },
    ),
    (Command(), {"type": "command/1"}),
    (
        Command(
            tick=3,
            drive=BodyVelocity(0.5, 0.0, -0.5),
            outbox=(Transmission("news", b"\xff"), Transmission("news", b"", 2)),
            wake=Wake(at_s=1.5, on_packet=True),
            release=True,
            done=True,
        ),
        {
            "type": "command/1",
            "tick": 3,
            "drive": {"kind": "velocity", "forward_m_s": 0.5, "left_m_s": 0.0, "turn_rad_s": -0.5},
            "outbox": [["news", b"\xff", None], ["news", b"", 2]],
            "wake": {"at_s": 1.5, "on_packet": True},
            "release": True,
            "done": True,
        },
    ),
    (
        Command(drive=WheelSpeeds(left_m_s=0.5)),
        {"type": "command/1", "drive": {"kind": "wheels", "left_m_s": 0.5, "right_m_s": 0.0}},
    ),
    (
        Failure(4, "ValueError: no", "..."),
        {"type": "failure/1", "tick": 4, "error": "ValueError: no", "traceback": "..."},
    ),
    (Hello(5, 0), {"type": "hello/1", "node": 5, "incarnation": 0}),
    (Goodbye("over"), {"type": "goodbye/1", "reason": "over"}),
    (Welcome(refused="stale"), {"type": "welcome/1", "refused": "stale"}),
]


@pytest.mark.parametrize(("message", "plain"), WIRE, ids=lambda each: type(each).__name__)
def test_plain_messagepack_reads_and_writes_every_message(message: object, plain: dict[str, Any]) -> None:
    assert msgpack.unpackb(encode(message)) == plain
    assert encode(msgspec.msgpack.decode(msgpack.packb(plain), type=type(message))) == encode(message)


def test_every_sensor_field_of_an_observation_is_on_the_wire_above() -> None:
    assert [name for name in WIRE[1][1] if name not in ("type", "tick", "time_s", "inbox")] == list(SENSOR_FIELDS)


def test_an_integer_is_taken_where_a_number_is_expected() -> None:
    answer = open_answer(msgpack.packb({"type": "command/1", "drive": {"kind": "wheels", "left_m_s": 1}}))
    assert answer == Command(drive=WheelSpeeds(1.0, 0.0))


# --- refusals -------------------------------------------------------------------------------------------------------

FULL = encode(WIRE[3][0])


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"outbox": [["news", "text"]]}, "outbox[0].payload: expected bytes, got 'text'"),
        ({"outbox": ["news", b"x", None]}, "outbox[0]: expected a Transmission, got 'news'"),
        ({"outbox": [["a", b""], ["b", b"", "all"]]}, "outbox[1].to: expected int | null, got 'all'"),
        ({"drive": [0.1, 0.2]}, "drive: expected BodyVelocity, WheelSpeeds or None, got [0.1, 0.2]"),
        ({"drive": {"kind": "wheels", "left_m_s": True}}, "drive.left_m_s: expected float, got True"),
        ({"wake": {"at_s": "\x1b[2J" + 99 * "x"}}, f"wake.at_s: expected float | null, got '\\x1b[2J{72 * 'x'}"),
        ({"wake": {"on_smell": True}}, "wake: Object contains unknown field `on_smell`"),
        ({"speed": 1.0}, "Object contains unknown field `speed`"),
    ],
)
def test_a_refused_field_is_named_as_in_the_class_with_its_value(fields: dict[str, Any], text: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        open_answer(msgpack.packb({"type": "command/1", "tick": 1} | fields))
    assert str(caught.value) == f"schema: {text}"


def reason_of(payload: bytes) -> str:
    with pytest.raises(ProtocolError) as caught:
        open_answer(payload)
    assert str(caught.value).startswith(f"{caught.value.reason}: ")
    return caught.value.reason


def command(**fields: Any) -> dict[str, Any]:
    return {"type": "command/1"} | fields


@pytest.mark.parametrize(
    ("plain", "reason"),
    [
        (command(speed=1.0), "schema"),
        (command(drive={"kind": "wheels", "speed": 1.0}), "schema"),
        (command(wake={"on_smell": True}), "schema"),
        (command(tick="1"), "schema"),
        (command(tick=1.0), "schema"),
        (command(tick=True), "schema"),
        (command(done=1), "schema"),
        (command(drive={"left_m_s": 1.0}), "schema"),
        (command(drive={"kind": "legs/2"}), "schema"),
        (command(outbox=[["news", "text, not bytes"]]), "schema"),
        (command(outbox=[["news", b"", 1, 2]]), "schema"),
        (command(outbox=[["news"]]), "schema"),
        ({"tick": 1}, "schema"),
        ({}, "schema"),
        ({1: 2}, "schema"),
        ([1, 2], "schema"),
        (None, "schema"),
        ({"type": "observation/1", "tick": 0, "time_s": 0.0}, "schema"),
        ({"type": "command"}, "schema"),
        ({"type": 1}, "schema"),
        ({"type": "command/2"}, "version"),
        ({"type": "command/0", "tick": 1}, "version"),
        ({"type": "failure/2"}, "version"),
        (command(drive={"kind": "wheels", "left_m_s": math.nan}), "not-finite"),
        (command(drive={"kind": "wheels", "right_m_s": math.inf}), "not-finite"),
        (command(drive={"kind": "velocity", "turn_rad_s": -math.inf}), "not-finite"),
        (command(drive={"kind": "velocity", "forward_m_s": math.inf, "left_m_s": -math.inf}), "not-finite"),
        (command(wake={"at_s": math.nan}), "not-finite"),
        (command(wake={"at_s": math.inf}), "not-finite"),
        (command(outbox=[["news", bytes(MESSAGE_BYTES_MAX)]]), "oversized"),
    ],
    ids=str,
)
def test_a_wrong_answer_is_refused_for_its_reason(plain: object, reason: str) -> None:
    assert reason_of(msgpack.packb(plain)) == reason


def carrying(count: int) -> bytes:
    return encode(Command(outbox=(Transmission("a", bytes(count)),)))


def test_an_answer_may_be_as_large_as_the_limit_and_no_larger() -> None:
    fits = MESSAGE_BYTES_MAX - (len(carrying(60_000)) - 60_000)
    assert len(carrying(fits)) == MESSAGE_BYTES_MAX
    assert isinstance(open_answer(carrying(fits)), Command)
    assert reason_of(carrying(fits + 1)) == "oversized"


def test_an_answer_truncated_anywhere_is_malformed() -> None:
    assert [reason_of(FULL[:length]) for length in range(len(FULL))] == ["malformed"] * len(FULL)


@given(st.binary(min_size=1, max_size=20))
def test_trailing_bytes_are_malformed(trailing: bytes) -> None:
    assert reason_of(FULL + trailing) == "malformed"


@pytest.mark.parametrize(
    "length",
    [b"\xdd\xff\xff\xff\xff", b"\xdc\xff\xff", b"\x91\x92\xa1a\xc6\xff\xff\xff\xff", b"\x91\x92\xdb\xff\xff\xff\xff"],
)
def test_a_length_beyond_the_end_of_a_message_allocates_no_memory(length: bytes) -> None:
    assert reason_of(b"\x82\xa4type\xa9command/1\xa6outbox" + length) == "malformed"


REASONS = {"schema", "version", "malformed", "oversized", "not-finite"}


def outcome(payload: bytes) -> str:
    """Return the reason for refusing the payload, or `accepted`; anything else that is raised is the test's failure."""
    try:
        open_answer(payload)
    except ProtocolError as error:
        return error.reason
    return "accepted"


def test_random_bytes_are_refused_and_raise_nothing_else() -> None:
    draw = random.Random(1)
    seen = {outcome(draw.randbytes(draw.randrange(1, 60))) for _ in range(20_000)}
    assert seen <= REASONS
    assert {"schema", "malformed"} <= seen


def test_a_command_with_bytes_changed_is_read_or_refused_and_raises_nothing_else() -> None:
    draw = random.Random(2)
    seen = set()
    for _ in range(20_000):
        bent = bytearray(FULL)
        for _ in range(draw.randrange(1, 4)):
            bent[draw.randrange(len(bent))] = draw.randrange(256)
        seen.add(outcome(bytes(bent)))
    assert seen <= REASONS | {"accepted"}
    assert {"schema", "version", "malformed", "accepted"} <= seen


@settings(max_examples=300)
@given(st.binary(max_size=60))
def test_no_decoder_raises_what_is_not_refusable(payload: bytes) -> None:
    for decode in (decode_observation, decode_answer, decode_hello, decode_welcome, decode_to_node):
        with suppress(*REFUSABLE):
            decode(payload)
