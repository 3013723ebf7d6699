"""Reading TOML of unknown origin: every text is tables or a TOMLDecodeError."""

import tomllib
from typing import Any, Final

_TOO_LONG: Final = "a number has too many digits"
_TOO_DEEP: Final = "arrays or tables are nested too deeply"
NESTING_MAX: Final = 64


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises tomllib.TOMLDecodeError also for a number of thousands of digits and for nesting without end, which `tomllib`
    reports in other ways.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:
        raise tomllib.TOMLDecodeError(_TOO_LONG) from None
    except RecursionError:
        raise tomllib.TOMLDecodeError(_TOO_DEEP) from None
    if _depth_exceeds(tables, NESTING_MAX):
        raise tomllib.TOMLDecodeError(_TOO_DEEP)
    return tables


def _depth_exceeds(tables: dict[str, Any], depth: int) -> bool:
    layer: list[Any] = [tables]
    for _ in range(depth):
        layer = [
            each
            for value in layer
            for each in (value.values() if isinstance(value, dict) else value)
            if isinstance(each, dict | list)
        ]
        if not layer:
            return False
    return True
