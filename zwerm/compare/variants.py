"""Arguments of a comparison on the command line: variants and sweeps.

A variant is `NAME` or `NAME:PATH=VALUE,PATH=VALUE`. A sweep is `PATH=VALUE,VALUE`: `A,B,...,Z` counts from A to Z in steps of
B - A, and `PATH+PATH` sets both paths. A value can be a table or an array, with a name before it or without:
`radio.models=none:[],bursts:[{kind="gilbert_elliott", loss_fraction=0.3}]`.
"""

import re
import tomllib
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from typing import Any, Final, NamedTuple

from zwerm.errors import ScenarioError
from zwerm.scenario.toml_text import parse_toml
from zwerm.study.study_tables import Setting, VariantTable

_OPENING, _CLOSING = "[{", "]}"
_NAMED: Final = re.compile(r"\s*([A-Za-z0-9][A-Za-z0-9 ._-]*):\s*(?=[\[{])")
_VARIANT: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._-]*")
_STEPS_MAX: Final = 1_000


class Sweep(NamedTuple):
    """One axis: its name is the path that it sets; its values are settings, or names of `levels`."""

    name: str
    values: list[Setting]
    levels: dict[str, list[str]]


def parse_variant(text: str) -> VariantTable:
    """Return the variant that an argument describes.

    Raises ScenarioError if the argument is malformed.
    """
    name, colon, settings = text.partition(":")
    found = split(settings) if colon else []
    if not _VARIANT.fullmatch(name) or any("=" not in each for each in found) or (colon and not found):
        raise ScenarioError([f"--variant: expected NAME or NAME:PATH=VALUE,PATH=VALUE, got {text!r}"])
    return VariantTable(name=name, set=found)


def parse_sweep(text: str) -> Sweep:
    """Return the axis that an argument describes.

    Raises ScenarioError if the argument is malformed.
    """
    name, equals, listed = text.partition("=")
    name, parts = name.strip(), split(listed)
    if not equals or not name or not parts:
        raise ScenarioError([f"--sweep: expected PATH=VALUE,VALUE, got {text!r}"])
    if "..." in parts:
        return Sweep(name, _count(parts, text), {})
    if any(part[0] in _OPENING or _NAMED.match(part) for part in parts):
        levels = dict(_level(name, part) for part in parts)
        return Sweep(name, list(levels), levels)
    values = [_value(part) for part in parts]
    if {type(each) for each in values} == {int, float}:
        values = [float(each) for each in values]
    return Sweep(name, values, {})


def split(text: str) -> list[str]:
    """Return the parts of a text between commas outside brackets and strings."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in _OPENING + _CLOSING:
            depth += 1 if letter in _OPENING else -1
        if letter == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def _level(name: str, part: str) -> tuple[str, list[str]]:
    """Return the name of a value, by default the value, and its settings for each path of the axis."""
    named = _NAMED.match(part)
    value = part[named.end() :] if named else part
    return named[1] if named else value, [f"{path}={value}" for path in name.split("+")]


def _count(parts: Sequence[str], text: str) -> list[Setting]:
    """Return the numbers of `A,B,...,Z`, computed in decimal."""
    try:
        first, second, dots, last = parts
        start, step, end = Decimal(first), Decimal(second) - Decimal(first), Decimal(last)
        if dots != "..." or not step or not 0 < (end - start) / step < _STEPS_MAX or (end - start) % step:
            raise ValueError
    except (ValueError, InvalidOperation):
        raise ScenarioError([f"--sweep: expected FIRST,SECOND,...,LAST in even steps, got {text!r}"]) from None
    numbers = [start + step * index for index in range(int((end - start) / step) + 1)]
    whole = all(each == each.to_integral_value() for each in numbers)
    return [int(each) if whole else float(each) for each in numbers]


def _value(part: str) -> Any:
    """Return a TOML value, or the text itself if it is not TOML."""
    try:
        return parse_toml(f"value = {part}")["value"]
    except tomllib.TOMLDecodeError:
        return part
