"""The parts of the documentation about public classes: every public name, and the fields of those that users read.

The meaning of a field is the comment behind it in the source.
"""

import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import Any, Final

import zwerm
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.world.scene import Scene

SHOWN: Final = (RunResult, zwerm.Positions, zwerm.TelemetryArrays, zwerm.Setup, zwerm.Body, Scene, zwerm.Truth)
BAR: Final = "\\|"  # within a table
_FIELD: Final = re.compile(
    r"^    (?P<name>[a-z]\w*): (?P<type>[^=#]+?)(?: = (?P<default>.+?))?(?:  # (?P<meaning>.+))?$"
)


def field_rows(kind: type[Any]) -> Iterator[tuple[str, str, str]]:
    """Yield the name, the type and the meaning of each field of a class.

    Raises KeyError where neither a comment nor the docstring says what a field means.
    """
    text = textwrap.dedent(inspect.getsource(kind))
    head = text.split("    def ")[0].split("    @property")[0]
    documented = inspect.getdoc(kind) or ""
    for line in head.splitlines():
        found = _FIELD.match(line)
        if found is None or found["name"] not in kind.__annotations__:
            continue
        if found["meaning"] is None and f"`{found['name']}`" not in documented:
            raise KeyError(f"{kind.__name__}.{found['name']}: no comment says what it means")
        yield found["name"], found["type"], found["meaning"] or "see above"


def object_fields() -> str:
    """Return the fields of every class of SHOWN."""
    parts = []
    for kind in SHOWN:
        lines = [f"### `{kind.__name__}`", "", re.sub(r"\s*\n\s*", " ", (inspect.getdoc(kind) or "")), ""]
        lines += ["| field | type | meaning |", "| --- | --- | --- |"]
        lines += [
            f"| `{name}` | `{type_.replace('|', BAR)}` | {meaning} |" for name, type_, meaning in field_rows(kind)
        ]
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def public_names() -> str:
    """Return every public name with the first sentence about it."""
    lines = ["| name | what it is |", "| --- | --- |"]
    for name in sorted(zwerm.__all__, key=str.lower):
        if not name.startswith("__"):
            found = run if name == "run" else getattr(zwerm, name)
            paragraph = (inspect.getdoc(found) or "").split("\n\n")[0]
            sentence = re.sub(r"\s+", " ", paragraph).split(". ")[0].rstrip(".")
            lines.append(f"| `{name}` | {sentence.replace('|', BAR)} |")
    return "\n".join(lines)
