"""The mistakes of a user in plain words: one line for each, `place: path: rule, got value`."""

import json
import re
from collections.abc import Sequence
from typing import Any, Literal, get_args, get_origin

import msgspec
from msgspec import Struct
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from zwerm.scenario.nearest import did_you_mean


def mistakes(error: ValidationError, place: str, prefix: str = "", table: type[BaseModel] | None = None) -> list[str]:
    """Return one line for every mistake in `error`: `place: path: rule, got value`.

    `table` is what was validated; with it, the line for an unknown key names the most similar known one.
    """
    lines = {}
    for each in error.errors(include_url=False):
        where, rule, got = _mistake(each)
        if each["type"] == "extra_forbidden" and table is not None:
            rule += did_you_mean(str(where[-1]), _keys_at(table, where[:-1]))
        path = prefix + ".".join(map(str, where))
        lines[f"{place}: {path}" if path else place] = rule if got is None else f"{rule}, got {got}"
    return [f"{where}: {what}" for where, what in lines.items()]


def _keys_at(table: type[BaseModel], where: Sequence[int | str]) -> list[str]:
    """Return the keys of the table at a path in `table`."""
    tables = [table]
    for key in where:
        fields = [each.model_fields[key] for each in tables if isinstance(key, str) and key in each.model_fields]
        if isinstance(key, str):
            tables = [inner for each in fields for inner in _tables_in(each.annotation)]
    return [key for each in tables for key in each.model_fields]


def _tables_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the tables in a type such as `list[Table] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for each in get_args(annotation) for found in _tables_in(each)]


_RULES = {
    "bool_type": "expected true or false",
    "dict_type": "expected a table",
    "finite_number": "expected a finite number",
    "float_type": "expected a number",
    "greater_than": "expected > {gt:g}",
    "greater_than_equal": "expected >= {ge:g}",
    "int_type": "expected an integer",
    "less_than": "expected < {lt:g}",
    "less_than_equal": "expected <= {le:g}",
    "list_type": "expected an array",
    "literal_error": "expected {expected}",
    "model_type": "expected a table",
    "string_pattern_mismatch": "expected a match of {pattern}",
    "string_type": "expected a string",
    "too_long": "expected {max_length} items at most",
    "too_short": "expected {min_length} items at least",
    "tuple_type": "expected an array",
}
_GOT_LENGTH_MAX = 60


def _mistake(each: ErrorDetails) -> tuple[tuple[int | str, ...], str, str | None]:
    """Return the path of the mistake, the rule, and the value as the file has it; None for a value that does not
    help."""
    where, kind, context, got = each["loc"], each["type"], each.get("ctx", {}), each["input"]
    if kind == "extra_forbidden":
        return where, "unknown key", None
    if kind == "missing" and isinstance(where[-1], int):
        return where[:-1], f"expected {where[-1] + 1} items", _shown(got)
    if kind == "missing":
        return where, "required, and missing", None
    if kind == "too_long" and context["field_type"] == "Tuple":
        rule = f"expected {context['max_length']} items"
    elif kind in _RULES:
        rule = _RULES[kind].format(**context).replace("'", '"')
    else:
        rule = re.sub(r"^(Value error, |Input should be |Input )", "", each["msg"])
        rule = rule if rule.startswith("expected") else f"expected {rule}"
    return where, rule, None if isinstance(got, dict) else _shown(got)


def struct_mistakes(kind: type[Struct], given: dict[str, Any], path: str) -> list[str]:
    """Return one line for every mistake in what is given for a struct: `path.key: rule, got value`."""
    fields = {each.encode_name: each for each in msgspec.structs.fields(kind)}
    found = [
        f"{path}.{key}: unknown key{did_you_mean(key, fields)}; known are {', '.join(fields) or 'none'}"
        for key in given
        if key not in fields
    ]
    for name, field in fields.items():
        if name in given:
            try:
                msgspec.convert(given[name], field.type)
            except msgspec.ValidationError as error:
                rule, _, inner = str(error).replace("`", "").partition(" - at $")
                if get_origin(field.type) is Literal:
                    rule = f"expected {' or '.join(map(repr, get_args(field.type)))}"
                found.append(f"{path}.{name}{inner}: {_as_ours(rule)}, got {_shown(given[name])}")
        elif field.required:
            found.append(f"{path}.{name}: required, and missing")
    if not found:
        try:
            msgspec.convert(given, kind)
        except msgspec.ValidationError as error:
            found.append(f"{path}: {error}, got {_shown(given)}")
    return found


def _as_ours(rule: str) -> str:
    """Return a rule of msgspec in the words that the other rules have: `expected a number`, `expected >= 1`."""
    rule = re.sub(r"^Expected (float|int) (?=[<>])", "expected ", re.sub(r", got \w+$", "", rule))
    for theirs, ours in (("float", "a number"), ("int", "an integer"), ("str", "a string"), ("bool", "true or false")):
        rule = re.sub(rf"\b{theirs}\b", ours, rule)
    return rule[0].lower() + rule[1:]


def _shown(value: Any) -> str:
    """Return the value as TOML would have it, cut where it is long."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= _GOT_LENGTH_MAX else text[:_GOT_LENGTH_MAX] + "..."
