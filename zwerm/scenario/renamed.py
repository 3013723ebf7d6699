"""Renamed keys and kinds of scenarios: the old names work for one version, with a warning that names the new ones.

A renamed key is one row of `KEYS`: old path to new path, both from the root of the scenario. A renamed kind is one row of
`KINDS`, by the path of an array of tables: the old `kind` and the new one. The values keep their meaning.
"""

import sys
from collections.abc import Callable
from typing import Any, Final

from zwerm.errors import ScenarioError

KEYS: Final[dict[str, str]] = {
    "robots.inflow": "robots.entrance",
}
_MODELS: Final = {"bursts": "gilbert_elliott", "walls": "wall_attenuation"}
KINDS: Final[dict[str, dict[str, str]]] = {"radio.models": _MODELS, "uplink.models": _MODELS}

Warn = Callable[[str], object]

_warned: dict[str, None] = {}


def warn_once(line: str) -> None:
    """Write a warning to standard error, unless this process has written the same one."""
    if line not in _warned:
        _warned[line] = None
        sys.stderr.write(f"zwerm: warning: {line}\n")


def renamed_path(path: str, place: str = "--set", warn: Warn = warn_once) -> str:
    """Return the current name of a dotted path, which may lead into a renamed table."""
    for old, new in KEYS.items():
        if path == old or path.startswith(f"{old}."):
            warn(f"{place}: {old} is deprecated, use {new}")
            return new + path[len(old) :]
    return path


def rename(tables: dict[str, Any], place: str, warn: Warn = warn_once) -> None:
    """Give renamed keys and kinds of `tables` their current names, in place; `place` leads each warning.

    Raises ScenarioError where both the old and the new key are given.
    """
    for old, new in KEYS.items():
        *parents, last = old.split(".")
        table = _table(tables, parents)
        if not isinstance(table, dict) or last not in table:
            continue
        *new_parents, new_last = new.split(".")
        target = tables
        for part in new_parents:
            target = target.setdefault(part, {})
        if new_last in target:
            raise ScenarioError([f"{place}: {old}: deprecated name of {new}, expected only one of them"])
        warn(f"{place}: {old} is deprecated, use {new}")
        target[new_last] = table.pop(last)
    for path, kinds in KINDS.items():
        rows = _table(tables, path.split("."))
        for index, row in enumerate(rows if isinstance(rows, list) else ()):
            kind = row.get("kind") if isinstance(row, dict) else None
            if isinstance(kind, str) and kind in kinds:
                warn(f"{place}: {path}.{index}.kind: {kind!r} is deprecated, use {kinds[kind]!r}")
                row["kind"] = kinds[kind]


def _table(tables: Any, path: list[str]) -> Any:
    """Return the table or array at a path, or None."""
    for part in path:
        tables = tables.get(part) if isinstance(tables, dict) else None
    return tables
