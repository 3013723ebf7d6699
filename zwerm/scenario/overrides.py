"""Settings of a scenario from the command line: `path=value`, applied to its tables before anything is checked."""

import tomllib
from collections.abc import Iterable, Sequence
from typing import Any, Final

from zwerm.errors import ScenarioError
from zwerm.scenario.renamed import renamed_path
from zwerm.scenario.toml_text import parse_toml

# A longer text that is no TOML is a mistake, such as a number of thousands of digits.
_BARE_CHARS_MAX: Final = 4_000
_SHOWN_CHARS_MAX: Final = 200


def override(tables: dict[str, Any], assignment: str) -> None:
    """Apply one `path=value` in place; value is TOML, or else a bare string. A number in the path indexes a list.

    Raises ScenarioError where the path leads nowhere.
    """
    path, equals, text = assignment.partition("=")
    if not equals or not path.strip():
        raise ScenarioError([f"--set {assignment}: expected path=value"])
    try:
        value = parse_toml(f"value = {text}")["value"] if "\n" not in text else text
    except tomllib.TOMLDecodeError:
        if len(text) > _BARE_CHARS_MAX:
            raise ScenarioError(
                [f"--set {assignment:.60}...: expected TOML, or a bare text of fewer characters"]
            ) from None
        value = text
    *parents, last = renamed_path(path.strip()).split(".")
    place: Any = tables
    for depth, part in enumerate(parents):
        place = _enter(place, part, ".".join(parents[: depth + 1]), assignment)
    if isinstance(place, list):
        place[_index(place, last, path, assignment)] = value
    elif isinstance(place, dict):
        place[last] = value
    else:
        raise ScenarioError([f"--set {assignment}: {'.'.join(parents)} is no table"])


def blame(lines: Iterable[str], place: str, overrides: Sequence[str]) -> list[str]:
    """Return lines `place: path: rule` with the override that set the path, or what is around it, as their place."""
    found = []
    for line in lines:
        path, colon, _ = line.removeprefix(f"{place}: ").partition(": ")
        if colon and line.startswith(f"{place}: "):
            guilty = [each for each in overrides if f"{path}.".startswith(f"{_path_of(each)}.")]
            if guilty:
                line = f"--set {_short(guilty[-1])}{line[len(place) :]}"
        found.append(line)
    return found


def _short(assignment: str) -> str:
    return assignment if len(assignment) <= _SHOWN_CHARS_MAX else f"{assignment[:_SHOWN_CHARS_MAX]}..."


def _path_of(assignment: str) -> str:
    return renamed_path(assignment.partition("=")[0].strip())


def _enter(place: Any, part: str, path: str, assignment: str) -> Any:
    if isinstance(place, list):
        return place[_index(place, part, path, assignment)]
    if isinstance(place, dict):
        return place.setdefault(part, {})
    raise ScenarioError([f"--set {assignment}: {path} is in no table"])


def _index(place: list[Any], part: str, path: str, assignment: str) -> int:
    indices = {str(index): index for index in range(len(place))}
    if part not in indices:
        raise ScenarioError(
            [f"--set {assignment:.80}: {path:.80}: expected an index below {len(place)}, got {part:.80}"]
        )
    return indices[part]
