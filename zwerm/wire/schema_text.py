"""Errors of the decoder in the terms of a controller: names of fields instead of positions, and the value that was sent."""

import re
from collections.abc import Mapping
from typing import Any, Final

import msgspec

from zwerm.wire.text import printable

# msgspec: "Expected `bytes`, got `str` - at `$.outbox[0][1]`"; a part in backticks may name several types.
_AT = re.compile(r"(?P<rule>.*) - at `\$\.?(?P<path>[^`]+)`", re.DOTALL)
_EXPECTED = re.compile(r"Expected `(?P<type>[^`]+)`, got `[^`]+`")
_STEP = re.compile(r"(\w+)|\[([0-9]{1,9})\]")
_VALUE_CHARS_MAX: Final = 80


def schema_text(text: str, payload: bytes, arrays: Mapping[str, tuple[str, ...]], types: Mapping[str, str]) -> str:
    """Return the text of a ValidationError as `field: expected rule, got value`, or unchanged where it names no field.

    `payload` is the message. `arrays` has the names of the fields of structs that are encoded as arrays, and `types`
    the types to name in place of those of MessagePack, both by the field, as in `outbox[]`.
    """
    at = _AT.fullmatch(text)
    if at is None:
        return text
    steps: list[str | int] = [name or int(index) for name, index in _STEP.findall(at["path"])]
    field, kind = "", ""
    for step in steps:
        if isinstance(step, str):
            field, kind = (f"{field}.{step}", f"{kind}.{step}") if field else (step, step)
        elif kind in arrays and step < len(arrays[kind]):
            field, kind = f"{field}.{arrays[kind][step]}", f"{kind}.{arrays[kind][step]}"
        else:
            field, kind = f"{field}[{step}]", f"{kind}[]"
    expected = _EXPECTED.fullmatch(at["rule"])
    value = _value(payload, steps)
    if expected is None or value is None:
        return f"{field}: {at['rule']}"
    return f"{field}: expected {types.get(kind, expected['type'])}, got {value}"


def _value(payload: bytes, steps: list[str | int]) -> str | None:
    """Return the value at a place of a message as text, or None where it cannot be read."""
    try:
        found: Any = msgspec.msgpack.decode(payload)
        for step in steps:
            found = found[step]
        return printable(repr(found)[:_VALUE_CHARS_MAX])
    except (msgspec.MsgspecError, LookupError, TypeError, ValueError, RecursionError):
        return None
