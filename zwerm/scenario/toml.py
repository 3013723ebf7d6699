"""Writing TOML: the tables of a scenario as a file that a person would not mind to edit.

Tables become sections, lists of tables arrays of tables, and everything inside a list is written in one line. What TOML has
no word for (None) is left out. `tomllib` reads back what was written.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def write_toml(tables: Mapping[str, Any]) -> str:
    """Return `tables` as TOML: plain values first, then a section for every table in them."""
    return "\n".join(_section(tables, ())).lstrip("\n") + "\n"


def _section(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    lines = [
        f"{_key(key)} = {_value(each)}" for key, each in table.items() if each is not None and not _is_section(each)
    ]
    for key, each in table.items():
        here = (*path, _key(key))
        if isinstance(each, Mapping):
            lines += ["", f"[{'.'.join(here)}]", *_section(each, here)]
        elif _is_section(each):
            for item in each:
                lines += ["", f"[[{'.'.join(here)}]]", *_section(item, here)]
    return lines


def _is_section(value: Any) -> bool:
    if isinstance(value, Mapping):
        return True
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(each, Mapping) for each in value)


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else _string(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(each)}" for key, each in value.items() if each is not None) + "}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(_value(each) for each in value) + "]"
    return _string(str(value))


def _string(text: str) -> str:
    """Return a basic string. JSON's escapes are TOML's, but for DEL, which JSON leaves as it is."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
