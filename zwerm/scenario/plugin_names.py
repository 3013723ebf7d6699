"""Plug-ins by name: `module:Class`, or `module:function`, as a scenario names those outside the catalogue."""

import importlib
from collections.abc import Iterable
from typing import Any


def object_named(name: str, what: str) -> Any:
    """Return the class or function that `name`, `module:name`, names.

    Raises ValueError, in one line, where it names none; `what` is then what was expected.
    """
    if not all(name.partition(":")):
        raise ValueError(f"expected module:name, got {name!r}")
    return _imported(name, what)


def class_named(name: str, what: str, built_in: Iterable[str]) -> type[Any]:
    """Return the class that `name`, `module:Class`, names.

    Raises ValueError, in one line, where it names none; `what` is then what was expected, `built_in` the shorter names.
    """
    if not all(name.partition(":")):
        raise ValueError(f"expected a built-in {what} ({', '.join(built_in)}) or module:Class, got {name!r}")
    found = _imported(name, "class")
    if not isinstance(found, type):
        module_name, _, class_name = name.partition(":")
        raise ValueError(f"module {module_name!r} has no class {class_name!r}")
    return found


def _imported(name: str, what: str) -> Any:
    module_name, _, object_name = name.partition(":")
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise ValueError(f"cannot import {module_name!r}: {error}") from error
    found = getattr(module, object_name, None)
    if found is None:
        raise ValueError(f"module {module_name!r} has no {what} {object_name!r}")
    return found
