"""Writing TOML: the tables of a scenario as a file to edit and to run again. `tomllib` reads back what was written."""

from collections.abc import Mapping
from typing import Any

import tomli_w


def write_toml(tables: Mapping[str, Any]) -> str:
    """Return `tables` as TOML. None, which TOML does not have, is left out."""
    return tomli_w.dumps(_without_none(tables))


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_none(each) for key, each in value.items() if each is not None}
    if isinstance(value, list | tuple):
        return [_without_none(each) for each in value if each is not None]
    return value
