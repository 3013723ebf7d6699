"""All messages on the wire: one `Observation` to a node, one `Command` back, and the messages that open and close a
connection.

Messages are MessagePack maps with field names, so that a node can be written in any language. Small parts that occur
often (a bearing, a contact) are MessagePack arrays. Every message carries its kind and the protocol version as
`type`, for example "command/1". Decoding is strict: unknown fields, wrong types, other versions, non-finite numbers and
trailing bytes are refused, each with a reason that is counted.

New fields go last, with defaults; a field at its default is left out of a message (except in drives). Angles are
radians in (-pi, pi], counter-clockwise; a bearing is measured in the body frame, x forward and y left.
"""

import re
from collections.abc import Callable
from math import isfinite
from typing import Any, Final

import msgspec
from msgspec import Struct

from zwerm.errors import ProtocolError
from zwerm.wire.schema_text import schema_text
from zwerm.wire.telemetry_rules import plain_numbers, telemetry_error

PROTOCOL_VERSION: Final = 1

# The largest message a node may send; a larger one is refused before it is decoded.
MESSAGE_BYTES_MAX: Final = 65_536


# Structs of numbers and bytes are part of no reference cycle: with `gc=False` the collector ignores them.


class _WirePart(Struct, frozen=True, gc=False, array_like=True, forbid_unknown_fields=True):
    """A part that may occur many times in a message: an array on the wire."""


class _WireMessage(Struct, frozen=True, gc=False, forbid_unknown_fields=True, omit_defaults=True, tag_field="type"):
    """A whole message: a map on the wire, led by its type and the protocol version."""


# --- what a node senses ---------------------------------------------------------------------------------------------


class Bearing(_WirePart, frozen=True):
    """A robot seen, by its id, in the direction `bearing_rad` of the body frame. No range."""

    node: int
    bearing_rad: float


class LandmarkBearing(_WirePart, frozen=True):
    """A landmark seen, by its id, in the direction `bearing_rad` of the body frame. No range."""

    landmark: int
    bearing_rad: float


class Contact(_WirePart, frozen=True):
    """One closed touch switch: contact within +-half_width_rad of bearing_rad, in the body frame."""

    bearing_rad: float
    half_width_rad: float


class Neighbour(_WirePart, frozen=True):
    """A robot's position relative to this one, in the body frame."""

    node: int
    x_m: float
    y_m: float


class FieldSample(_WirePart, frozen=True):
    """A scalar field's value where the robot stands, and its gradient [1/m] in the body frame."""

    value: float
    gradient_x: float
    gradient_y: float


class Pose(_WirePart, frozen=True):
    """Position and heading in the frame of the arena."""

    x_m: float
    y_m: float
    heading_rad: float


class Displacement(_WirePart, frozen=True):
    """Motion since the node's previous observation, in the body frame it had then."""

    forward_m: float
    left_m: float
    turn_rad: float


class Packet(_WirePart, frozen=True):
    """A radio packet delivered now. `sender` is None on an anonymous channel."""

    channel: str
    payload: bytes
    sender: int | None = None


class Observation(_WireMessage, frozen=True, tag=f"observation/{PROTOCOL_VERSION}"):
    """The input of a node at one tick. A sensor that the node does not have is None, and not on the wire."""

    tick: int
    time_s: float
    inbox: tuple[Packet, ...] = ()
    line_of_sight: bool | None = None
    bearings: tuple[Bearing, ...] | None = None
    touch: tuple[Contact, ...] | None = None
    landmarks: tuple[LandmarkBearing, ...] | None = None
    neighbours: tuple[Neighbour, ...] | None = None
    field: FieldSample | None = None
    pose: Pose | None = None
    boundary: tuple[tuple[float, float], ...] | None = None
    odometry: Displacement | None = None
    compass_rad: float | None = None
    extra: dict[str, tuple[float, ...]] | None = None


SENSOR_FIELDS: Final = Observation.__struct_fields__[3:]


# --- what a node commands -------------------------------------------------------------------------------------------


# Drives are encoded with all fields. msgspec omits a default number only if it is the same object. Equal drives could
# otherwise differ in their bytes, and equal runs in their traces.


class BodyVelocity(Struct, frozen=True, gc=False, forbid_unknown_fields=True, tag_field="kind", tag="velocity"):
    """Velocity of a holonomic body in its own frame."""

    forward_m_s: float = 0.0
    left_m_s: float = 0.0
    turn_rad_s: float = 0.0


class WheelSpeeds(Struct, frozen=True, gc=False, forbid_unknown_fields=True, tag_field="kind", tag="wheels"):
    """Ground speed of the two wheels of a differential drive."""

    left_m_s: float = 0.0
    right_m_s: float = 0.0


class Transmission(_WirePart, frozen=True):
    """A radio packet to send: to every node that receives it, or to the one node `to`."""

    channel: str
    payload: bytes
    to: int | None = None


class Wake(Struct, frozen=True, gc=False, forbid_unknown_fields=True, omit_defaults=True):
    """The time of the node's next observation: `at_s`, or the first of the events it names, if that is earlier.

    With nothing set the node sleeps until the run ends.
    """

    at_s: float | None = None
    on_packet: bool = False
    on_contact: bool = False
    on_visible: bool = False


class Command(
    Struct,
    gc=False,
    forbid_unknown_fields=True,
    omit_defaults=True,
    tag_field="type",
    tag=f"command/{PROTOCOL_VERSION}",
):
    """A node's answer to one observation.

    `drive` None leaves the drive as it was, and it persists while the node sleeps. `wake` None asks for an observation
    at every tick. `release`: a base station lets one robot out of its depot. `done`: the node's part of the task is
    complete. `gave_up`, if not empty, is the reason why that part cannot be completed. The program that runs the
    controller sets `tick`: the tick of the observation answered.

    `telemetry` is named numbers for the observers of the run; no node receives them. `snapshot` is one record in the
    algorithm's own encoding for its metric and picture classes. The trace covers neither.
    """

    tick: int = 0
    drive: BodyVelocity | WheelSpeeds | None = None
    outbox: tuple[Transmission, ...] = ()
    wake: Wake | None = None
    release: bool = False
    done: bool = False
    gave_up: str = ""
    telemetry: dict[str, float | bool] = {}
    snapshot: bytes = b""


class Failure(_WireMessage, frozen=True, tag=f"failure/{PROTOCOL_VERSION}"):
    """A controller raised: the last message of a node, in place of its command."""

    tick: int
    error: str
    traceback: str


# --- how a node joins and leaves ------------------------------------------------------------------------------------


class Hello(_WireMessage, frozen=True, tag=f"hello/{PROTOCOL_VERSION}"):
    """A node asks to join under the incarnation it was started with.

    `software` names its releases (`zwerm.link.software`); a node on the world's own machine leaves it empty. That node
    tells the id of its process, others 0.
    """

    node: int
    incarnation: int
    software: str = ""
    process: int = 0


class Welcome(_WireMessage, frozen=True, tag=f"welcome/{PROTOCOL_VERSION}"):
    """The world's answer to `Hello`: the node's controller and setup, or the reason of a refusal.

    In a `paced` run (real time) observations come also while the node has not answered the one before.
    """

    refused: str = ""
    controller: str = ""
    setup: msgspec.Raw = msgspec.Raw(b"\xc0")
    paced: bool = False
    detail: str = ""  # of a refusal
    code: str = ""  # a digest of the controller's file in the world, to be compared with the node's


class Goodbye(_WireMessage, frozen=True, tag=f"goodbye/{PROTOCOL_VERSION}"):
    """The world ends a node's run and gives the reason; the node closes and exits. Or a node leaves."""

    reason: str


# --- encode and decode ----------------------------------------------------------------------------------------------


def _plain(value: Any) -> Any:
    """Return a NumPy scalar as a number of Python. Raises TypeError for any other type that has no encoding."""
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):
        return value.item()
    raise TypeError(f"a message holds no {type(value).__name__}, got {value!r:.80}")


_encoder = msgspec.msgpack.Encoder(enc_hook=_plain)
encode: Final[Callable[[object], bytes]] = _encoder.encode

# For the hot paths; `refusal` turns their exceptions into a ProtocolError. In a union a message must carry its type.
decode_observation: Final = msgspec.msgpack.Decoder(Observation).decode
decode_answer: Final = msgspec.msgpack.Decoder(Command | Failure).decode
decode_hello: Final = msgspec.msgpack.Decoder(Hello | Goodbye).decode
decode_welcome: Final = msgspec.msgpack.Decoder(Welcome).decode
decode_to_node: Final = msgspec.msgpack.Decoder(Observation | Goodbye).decode

# The error text of msgspec for a message of another type, such as "command/2".
_OTHER_TYPE = re.compile(r"Invalid value '\w+/([0-9]{1,9})' - at `\$\.type`")

# How a controller's author calls what MessagePack calls an array or an object.
_ARRAYS: Final = {"outbox[]": Transmission.__struct_fields__}
_TYPES: Final = {
    "drive": "BodyVelocity, WheelSpeeds or None",
    "outbox": "a tuple of Transmission",
    "outbox[]": "a Transmission",
    "wake": "Wake or None",
}

REFUSABLE: Final = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)


def refusal(error: Exception) -> ProtocolError:
    """Return the exception of a decoder as a ProtocolError.

    Its reason is `schema` (unknown or missing field, wrong type, another message), `version`, or `malformed` (not
    MessagePack, truncated, trailing bytes).
    """
    if isinstance(error, msgspec.ValidationError):
        text = str(error)
        tag = _OTHER_TYPE.fullmatch(text)
        return ProtocolError("version" if tag and int(tag[1]) != PROTOCOL_VERSION else "schema", text)
    return ProtocolError("malformed", str(error))


def open_answer(payload: bytes) -> Command | Failure:
    """Return the command or failure in `payload`.

    Raises ProtocolError with the reasons of `refusal`, or `oversized`; or `not-finite` for a number in the drive or the
    wake; or `telemetry` for a name or number that breaks the rules of `zwerm.wire.telemetry_rules`.
    """
    if len(payload) > MESSAGE_BYTES_MAX:
        raise ProtocolError("oversized", f"{len(payload)} bytes, at most {MESSAGE_BYTES_MAX}")
    try:
        answer: Command | Failure = decode_answer(payload)
    except REFUSABLE as error:
        found = refusal(error)
        # A number of another type: the decoder names the field, not the key.
        if "`$.telemetry" in str(found):
            raise ProtocolError("telemetry", str(found)) from None
        if found.reason == "schema":
            raise ProtocolError("schema", schema_text(str(error), payload, _ARRAYS, _TYPES)) from None
        raise found from None
    if type(answer) is Command:
        drive, wake = answer.drive, answer.wake
        # A sum is finite only if each of its terms is. The exact type is compared, which is faster than isinstance.
        total = 0.0
        if type(drive) is BodyVelocity:
            total = drive.forward_m_s + drive.left_m_s + drive.turn_rad_s
        elif type(drive) is WheelSpeeds:
            total = drive.left_m_s + drive.right_m_s
        if not isfinite(total):
            raise ProtocolError("not-finite", repr(drive))
        if wake is not None and wake.at_s is not None and not isfinite(wake.at_s):
            raise ProtocolError("not-finite", repr(wake))
        if answer.telemetry and (rule := telemetry_error(answer.telemetry)):
            raise ProtocolError("telemetry", rule)
    return answer


def encode_command(command: Command) -> bytes:
    """Return a controller's command as it crosses the wire, its telemetry as plain floats.

    Raises TypeError or ValueError that names the field, the rule and the value.
    """
    if command.telemetry or command.snapshot:
        check_records(command)
    return encode(command)


def check_records(command: Command) -> None:
    """Check a controller's telemetry and snapshot, and turn the telemetry into plain floats.

    Raises TypeError or ValueError that names the field, the rule and the value.
    """
    if command.telemetry:
        command.telemetry = plain_numbers(command.telemetry)
    if command.snapshot and type(command.snapshot) is not bytes:
        raise TypeError(f"snapshot: expected bytes, got {type(command.snapshot).__name__}")


def traced_bytes(command: Command, payload: bytes) -> bytes:
    """Return the bytes of a command that the trace covers: those of the command without `telemetry` and `snapshot`.

    They are `payload` itself where the command carries neither.
    """
    if not command.telemetry and not command.snapshot:
        return payload
    return encode(msgspec.structs.replace(command, telemetry={}, snapshot=b""))
