"""Telemetry on the wire: the rule for the named numbers of a command, and their conversion on the node's side.

A name is `[a-z][a-z0-9_]*` of at most 64 characters; a command carries at most 64 names; every value is a finite number.
`telemetry_error` is the world's check. `plain_numbers` is the node's: it accepts NumPy scalars, and names the value it refuses.
"""

import re
from collections.abc import Mapping
from math import isfinite
from typing import Any, Final

NAMES_MAX: Final = 64
NAME_CHARS_MAX: Final = 64
_NAME: Final = re.compile(r"[a-z][a-z0-9_]*")
_NAME_RULE: Final = f"expected a name of [a-z][a-z0-9_]*, at most {NAME_CHARS_MAX} characters"
_SHOWN_CHARS_MAX: Final = 80


def is_telemetry_name(name: str) -> bool:
    """Return whether telemetry may carry this name."""
    return len(name) <= NAME_CHARS_MAX and _NAME.fullmatch(name) is not None


def telemetry_error(telemetry: Mapping[str, float]) -> str:
    """Return the first broken rule in decoded telemetry, with its name and value; "" where there is none."""
    if len(telemetry) > NAMES_MAX:
        return f"telemetry: expected at most {NAMES_MAX} names, got {len(telemetry)}"
    for name, value in telemetry.items():
        if not is_telemetry_name(name):
            return f"telemetry: {_NAME_RULE}, got {_shown(name)}"
        if not isfinite(value):
            return f"telemetry.{name}: expected a finite number, got {value}"
    return ""


def plain_numbers(telemetry: Mapping[str, Any]) -> dict[str, float]:
    """Return what a controller gave as telemetry with every value a float.

    Raises TypeError or ValueError that names the rule, the name and the value.
    """
    if not isinstance(telemetry, Mapping):
        raise TypeError(f"telemetry: expected a dict of numbers by name, got {_shown(telemetry)}")
    numbers: dict[str, float] = {}
    for name, value in telemetry.items():
        if not isinstance(name, str):
            raise TypeError(f"telemetry: {_NAME_RULE}, got {_shown(name)}")
        # NumPy scalars are numbers; text and arrays are not, although `float` takes some of them.
        if isinstance(value, str | bytes) or not hasattr(value, "__float__") or getattr(value, "ndim", False):
            raise TypeError(f"telemetry.{name[:NAME_CHARS_MAX]}: expected a number, got {_shown(value)}")
        try:
            numbers[name] = float(value)
        except OverflowError:
            raise ValueError(
                f"telemetry.{name[:NAME_CHARS_MAX]}: expected a finite number, got {_shown(value)}"
            ) from None
    if error := telemetry_error(numbers):
        raise ValueError(error)
    return numbers


def _shown(value: object) -> str:
    try:
        text = repr(value)
    except Exception:  # the code of a user, or an integer of too many digits
        text = f"a {type(value).__name__}"
    return text if len(text) <= _SHOWN_CHARS_MAX else text[:_SHOWN_CHARS_MAX] + "..."
