"""Plug-ins by name: `module:Class`, or `module:function`, as a scenario names those outside the catalogue.

A module is looked for in the scenario's folder, then in the working directory, then among the installed packages.
"""

import importlib
import inspect
import sys
import traceback
from collections.abc import Iterable, Iterator
from functools import lru_cache
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from zwerm.scenario.nearest import did_you_mean, nearest

# The folders of the scenarios that ship with Zwerm: no module of a user is there.
_OWN: Final = Path(__file__).parents[1].resolve()


def search_first(folder: Path) -> None:
    """Look for modules in a scenario's folder before any other place from now on."""
    found = folder.resolve()
    if found.parent.name == "scenarios" and found.parents[1] in (_OWN, _OWN.parent):
        return
    place = str(found)
    if sys.path[:1] != [place]:
        sys.path[:] = [place, *(each for each in sys.path if each != place)]


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
        known = list(built_in)
        expected = f"expected a built-in {what} ({', '.join(known)}) or module:Class"
        raise ValueError(f"{expected}, got {name!r}{did_you_mean(name, known)}")
    found = _imported(name, "class")
    if not isinstance(found, type):
        module_name, _, class_name = name.partition(":")
        raise ValueError(f"module {module_name!r} has no class {class_name!r}")
    return found


def takes(found: Any, count: int) -> bool:
    """Return whether a class can be called with `count` arguments. A swarm asks this of one class many times."""
    return _takes(found, count)


@lru_cache(maxsize=128)
def _takes(found: Any, count: int) -> bool:
    try:
        inspect.signature(found).bind(*(None for _ in range(count)))
    except (TypeError, ValueError):
        return False
    return True


def _imported(name: str, what: str) -> Any:
    module_name, _, object_name = name.partition(":")
    try:
        module = importlib.import_module(module_name)
    except SyntaxError as error:
        raise ValueError(f"cannot import {module_name!r}: {_syntax_error(error)}") from error
    except (Exception, SystemExit) as error:
        place = _raised_at(error)
        hint = "" if place else _similar_module(module_name, object_name)
        raise ValueError(f"cannot import {module_name!r}: {error}{place}{hint}") from error
    if elsewhere := _nearer(module):
        raise ValueError(
            f"module {module_name!r} was imported from {_place_of(module)}, and {elsewhere} has the same name: rename one"
        )
    found = getattr(module, object_name, None)
    if found is None:
        similar = did_you_mean(object_name, (each for each in vars(module) if not each.startswith("_")))
        raise ValueError(f"module {module_name!r} has no {what} {object_name!r}{similar}{_where(module)}")
    return found


def _similar_module(module_name: str, object_name: str) -> str:
    """Return the most similar name by which a file of the user can be imported, as the rest of a line.

    The name of a file, such as `./robot.py`, is taken for the module in it.
    """
    stem = Path(module_name).name.removesuffix(".py")
    folders = dict.fromkeys(Path(each) for each in sys.path[:2])  # those of the scenario and of the command
    files = sorted(name for folder in folders for name in _modules_in(folder))
    found = [stem] if stem in files else nearest(stem, files)
    return f"; did you mean {found[0]}:{object_name}?" if found else ""


def _modules_in(folder: Path) -> list[str]:
    """Return the names of the Python files in a folder; none where this user may not read it."""
    try:
        return [file.stem for file in folder.glob("*.py")]
    except OSError:
        return []


def _syntax_error(error: SyntaxError) -> str:
    return f"{type(error).__name__}: {error.msg} ({error.filename}:{error.lineno})"


def _raised_at(error: BaseException) -> str:
    """Return the kind and the place of an error that a module raised while it was imported, or the empty text.

    If the module itself does not exist, no line of it was run.
    """
    frames = [each for each in traceback.extract_tb(error.__traceback__) if "importlib" not in each.filename]
    last = frames[-1] if len(frames) > 1 else None
    if last is None:
        return ""
    kind = "" if isinstance(error, ImportError) else f"{type(error).__name__}, "
    return f" ({kind}{last.filename}:{last.lineno})"


def _where(module: ModuleType) -> str:
    """Return the place of a module that is a folder, or hides others of its name, as the rest of a line."""
    place = _place_of(module)
    hidden = [each for each in _places(module.__name__) if each != place]
    if hidden:
        return f"; it is {place}, which hides {' and '.join(hidden)}"
    return f"; it is {place}" if place and getattr(module, "__file__", None) is None else ""


def _nearer(module: ModuleType) -> str:
    """Return the file that an import of a module would find now, if it is another one than was imported, or ""."""
    found = next(_places(module.__name__), "")
    known = _place_of(module)
    same = not found or not known or Path(found).resolve() == Path(known).resolve()
    return "" if same or known.startswith("the folder") or found.startswith("the folder") else found


def _place_of(module: ModuleType) -> str:
    file: str | None = getattr(module, "__file__", None)  # the program itself has no such attribute in a session
    if file is not None:
        return file
    folder = next(iter(getattr(module, "__path__", ())), "")
    return f"the folder {folder}" if folder else ""


def _places(name: str) -> Iterator[str]:
    """Yield the files and folders of modules of this name on the search path, a nearer one first."""
    if "." in name or name == "__main__":
        return
    for entry in sys.path:
        spec = PathFinder.find_spec(name, [entry])
        if spec is not None:
            yield spec.origin or f"the folder {Path(entry) / name}"
