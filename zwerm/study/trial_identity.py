"""The identity of a trial: all that decides its result, except the seed.

It depends on the scenario, the arena, the files that the scenario names, and the user's modules that the trial can
load. It also depends on Zwerm, and on the versions of Python and of the libraries that Zwerm computes with. Zwerm
counts by its version, and by the content of its code where it runs from a source tree, whose version does not change
with the code.

Import statements do not name every module. So a row also records the user's modules that its trial loaded by a computed
name. It is used again only while their files are the same. Code that cannot be known is stated in words; its rows are
never used again.
"""

import json
import platform
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from zwerm.catalogue import ALGORITHMS, algorithm_of
from zwerm.scenario.tables import Scenario
from zwerm.scenario.user_modules import SourceFile, UserModules, digest_of, find_user_modules, is_users, spec_of
from zwerm.version import __version__

# Libraries whose versions can change a result.
LIBRARIES: Final = ("numpy", "scipy", "shapely", "pymunk", "pillow", "pyyaml")
# Descriptive keys of a scenario; runs do not depend on them.
_DESCRIPTIVE: Final = {"name", "summary", "source"}
_PATH_CHARS_MAX: Final = 255
# Folders of Zwerm whose code decides no result.
_SHOWING: Final = ("cli", "compare", "evolve", "network", "record", "study", "twin", "view")

# The digest of each user module's file when this process was first known to have imported it, by path.
_imported: dict[str, str] = {}


class Identities:
    """Identities of the trials of one study. Files are read once for all its scenarios."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, ...], UserModules] = {}

    def modules(self, scenario: Scenario, runner: str) -> UserModules:
        """Return the user's modules of a scenario whose plug-ins are imported.

        A module whose file has changed since this process imported it is unknown. If robots are processes, so are
        modules that are imported by a computed name.
        """
        names = tuple(_module_names(scenario.model_dump(mode="json")))
        if names not in self._found:
            self._found[names] = find_user_modules(names)
        found = self._found[names]
        unknown = [
            *found.unknown,
            *(f"{each.path} changed after it was imported" for each in found.files if not _is_as_imported(each)),
        ]
        if runner == "processes":
            unknown += [f"module {name!r} imports by a name that it computes" for name in found.dynamic]
        return UserModules(found.files, found.versions, tuple(unknown), found.dynamic)

    def fingerprint(self, scenario: Scenario, walls: bytes, modules: UserModules) -> str:
        """Return the identity of the trials of a scenario, its arena's `walls`, and the user's modules."""
        digest = blake2b(digest_size=16)
        tables = scenario.model_dump(mode="json", exclude=_DESCRIPTIVE)
        parts = [zwerm_identity(scenario), *library_versions(), json.dumps(tables, sort_keys=True)]
        parts += [f"{each.module} {each.digest}" for each in modules.files]
        parts += [*modules.versions, *(f"unknown: {each}" for each in modules.unknown)]
        for part in parts:
            digest.update(part.encode() + b"\0")
        digest.update(walls)
        for text in _texts(tables):
            file = scenario.folder / text[:_PATH_CHARS_MAX]
            if "\0" not in text and file.is_file():
                digest.update(file.read_bytes())
        return digest.hexdigest()


@cache
def library_versions() -> tuple[str, ...]:
    """Return the versions of Python and of the libraries that Zwerm computes with."""
    python = f"{platform.python_implementation()} {platform.python_version()}"
    return (python, *(f"{name} {version(name)}" for name in LIBRARIES))


def zwerm_identity(scenario: Scenario) -> str:
    """Return Zwerm's version, and in a source tree a digest of the code that runs of a scenario may use."""
    controllers = [
        table.controller for table in (scenario.robots, scenario.base, scenario.coordinator) if table is not None
    ]
    rows = [row.name for name in controllers if (row := algorithm_of(name)) is not None]
    return f"zwerm {__version__} {_code_digest(tuple(sorted(set(rows))))}"


@cache
def _code_digest(algorithms: tuple[str, ...]) -> str:
    """Return a digest of Zwerm's code but for that of other algorithms; the empty text where Zwerm is installed."""
    package = Path(__file__).parents[1]
    if str(package).startswith(tuple(sysconfig.get_path(each) for each in ("purelib", "platlib"))):
        return ""
    others = {row.name for row in ALGORITHMS} - set(algorithms)
    digest = blake2b(digest_size=16)
    for path in sorted(_code_files(package)):
        parts = path.relative_to(package).with_suffix("").parts
        if not others.intersection(parts) and parts[0] not in _SHOWING and parts[:2] != ("deploy", "network"):
            digest.update("/".join(parts).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _code_files(package: Path) -> Iterator[Path]:
    """Yield the source files below Zwerm's package. The rooms are links in a source tree, which a glob does not
    follow."""
    for folder in (package, *(each for each in package.iterdir() if each.is_symlink())):
        yield from folder.rglob("*.py")


class LoadedModules:
    """The user's modules that a trial loads, against those that its point was planned with."""

    def __init__(self, planned: UserModules, in_processes: bool = False) -> None:
        """Record the current content of the planned files. `in_processes`: robots import them again in every trial."""
        self._planned = planned
        self._in_processes = in_processes
        self._changed = self._first_changed()

    def changed(self) -> str:
        """Return the file of a planned module that is no longer as planned, or the empty text.

        A module that this process has imported as planned stays as it is in memory.
        """
        changed = self._changed or self._first_changed()
        if not changed:
            _imported.update(
                {each.path: each.digest for each in self._planned.files if _file_of(each.module) == each.path}
            )
        return changed

    def _first_changed(self) -> str:
        for each in self._planned.files:
            known = None if self._in_processes else _imported.get(each.path)
            if (digest_of(each.path) if known is None else known) != each.digest:
                return each.path
        return ""

    def others(self) -> str:
        """Return the loaded user modules that were not planned, as JSON: digest by name.

        The text is empty where there is none, or where no planned module imports by a computed name. If one does,
        modules that other code of this process has loaded are among them: more than needed is recorded, never less.
        """
        planned = {each.module for each in self._planned.files}
        found: dict[str, str] = {}
        for name in sorted(set(sys.modules) - planned) if self._planned.dynamic else ():
            path = _file_of(name)
            if path is not None and is_users(name, path):
                found[name] = _imported.setdefault(path, digest_of(path))
        return json.dumps(found) if found else ""


def still_same(recorded: str) -> bool:
    """Return whether the modules that a row recorded, as `LoadedModules.others` returned them, have the same files
    now."""
    if not recorded:
        return True
    for name, digest in json.loads(recorded).items():
        spec = spec_of(name)
        if spec is None or spec.origin is None or digest_of(spec.origin) != digest:
            return False
    return True


def _is_as_imported(file: SourceFile) -> bool:
    """Return whether a module is not imported yet, or was imported from a file that was as it is now."""
    if _file_of(file.module) != file.path:
        _imported.pop(file.path, None)
        return True
    return _imported.setdefault(file.path, file.digest) == file.digest


def _file_of(module: str) -> str | None:
    return getattr(sys.modules.get(module), "__file__", None)


def _module_names(tables: Mapping[str, Any]) -> Iterator[str]:
    """Yield the module of every `module:name` in nested tables, among keys too."""
    for text in _texts(tables, keys=True):
        module, colon, name = text.partition(":")
        if colon and name and all(part.isidentifier() for part in module.split(".")):
            yield module


def _texts(value: Any, keys: bool = False) -> Iterable[str]:
    """Yield every string in nested tables and arrays, in order."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for key, each in value.items():
            if keys:
                yield key
            yield from _texts(each, keys)
    elif isinstance(value, list):
        for each in value:
            yield from _texts(each, keys)
