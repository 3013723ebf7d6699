"""Files among the parameters of a controller: a controller reads no file; it gets the text.

A parameter whose name ends in `_file` is a path, relative to the scenario. The starter of a node puts the file's text
in its place. So a robot process on another machine needs no file.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from zwerm.errors import ScenarioError

SUFFIX: Final = "_file"

# A larger file is refused: it would not fit into the message that gives a node its role.
FILE_BYTES_MAX: Final = 8_000_000


def with_file_texts(parameters: Mapping[str, Any], folder: Path, table: str) -> dict[str, Any]:
    """Return parameters with the text of every file in place of its path.

    Raises ScenarioError where a file cannot be read; `table` is where the parameters stand.
    """
    found = dict(parameters)
    mistakes = []
    for name, value in parameters.items():
        if not name.endswith(SUFFIX) or not isinstance(value, str):
            continue
        path = folder / value
        try:
            if path.stat().st_size > FILE_BYTES_MAX:
                mistakes.append(f"{table}.{name}: expected a file of at most {FILE_BYTES_MAX} bytes, got {value!r}")
                continue
            found[name] = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "is no UTF-8 text"
            mistakes.append(f"{table}.{name}: cannot be read: {reason}, got {value!r}")
    if mistakes:
        raise ScenarioError(mistakes)
    return found
