"""Classes by name: `module:Class`, as a scenario names a controller, a sensor or a model of somebody else's."""

import importlib
from collections.abc import Iterable
from typing import Any


def class_named(name: str, what: str, built_in: Iterable[str]) -> type[Any]:
    """Return the class that `name`, `module:Class`, names.

    Raises ValueError, in one line, where it names none; `what` is then what was expected, `built_in` the shorter names.
    """
    module_name, _, class_name = name.partition(":")
    if not module_name or not class_name:
        raise ValueError(f"expected a built-in {what} ({', '.join(built_in)}) or module:Class, got {name!r}")
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise ValueError(f"cannot import {module_name!r}: {error}") from error
    found = getattr(module, class_name, None)
    if not isinstance(found, type):
        raise ValueError(f"module {module_name!r} has no class {class_name!r}")
    return found
