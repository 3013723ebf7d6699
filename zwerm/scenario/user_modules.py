"""The user's own modules that a trial can load, found without importing anything.

The search starts at the modules that a scenario names and follows every import statement, also those inside functions. A
module of the standard library counts by Python's version, one of an installed distribution by the distribution's version,
every other one by the content of its file. Modules of a package that a scenario names count by content wherever they are.
"""

import ast
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from hashlib import blake2b
from importlib.machinery import ModuleSpec
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from pathlib import Path
from typing import Final, NamedTuple

# Functions that run code which no import statement names.
_RUN_CODE: Final = ("exec", "spec_from_file_location", "run_path", "run_module")
_IMPORT: Final = ("import_module", "__import__")
_BUILT_IN: Final = ("built-in", "frozen")


class SourceFile(NamedTuple):
    """The file of a module and a digest of its content."""

    module: str
    path: str
    digest: str


@dataclass(frozen=True)
class UserModules:
    """The user's modules that a trial can load.

    `versions` are those of the distributions that they import. `unknown` says in words which code cannot be known. `dynamic`
    names modules that import others by a name that is computed.
    """

    files: tuple[SourceFile, ...] = ()
    versions: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    dynamic: tuple[str, ...] = ()


def digest_of(path: str | Path) -> str:
    """Return a digest of the content of a file; the empty text where it cannot be read."""
    try:
        return blake2b(Path(path).read_bytes(), digest_size=16).hexdigest()
    except OSError:
        return ""


def find_user_modules(names: Iterable[str]) -> UserModules:
    """Return the user's modules that can be loaded where the modules `names` are."""
    search = _Search(tuple(dict.fromkeys(names)))
    return search.result()


def is_users(name: str, path: str) -> bool:
    """Return whether a module of this name and file is neither Zwerm's, nor Python's, nor of an installed distribution."""
    top = name.partition(".")[0]
    return top != "zwerm" and not _is_below(path, (*_standard_folders(), *_package_folders()))


def spec_of(name: str) -> ModuleSpec | None:
    """Return the spec of a module without importing it or a package around it, or None where there is none."""
    found: ModuleSpec | None = None
    parts = name.split(".")
    for depth in range(1, len(parts) + 1):
        search = None if found is None else found.submodule_search_locations
        if found is not None and search is None:
            return None
        found = _spec_in(".".join(parts[:depth]), search)
        if found is None:
            return None
    return found


def _spec_in(name: str, search: Sequence[str] | None) -> ModuleSpec | None:
    loaded: ModuleSpec | None = getattr(sys.modules.get(name), "__spec__", None)
    if loaded is not None:
        return loaded
    for finder in sys.meta_path:
        found = finder.find_spec(name, search) if hasattr(finder, "find_spec") else None
        if found is not None:
            return found
    return None


@dataclass
class _Search:
    """A search from the modules `named`, breadth first."""

    named: tuple[str, ...]
    files: dict[str, SourceFile] = field(default_factory=dict)
    versions: dict[str, None] = field(default_factory=dict)
    unknown: dict[str, None] = field(default_factory=dict)
    dynamic: dict[str, None] = field(default_factory=dict)
    seen: dict[str, None] = field(default_factory=dict)

    def result(self) -> UserModules:
        """Return what the search finds."""
        waiting = list(self.named)
        while waiting:
            name = waiting.pop(0)
            if name not in self.seen:
                self.seen[name] = None
                waiting += self._visit(name)
        files = tuple(self.files[name] for name in sorted(self.files))
        return UserModules(files, tuple(sorted(self.versions)), tuple(self.unknown), tuple(self.dynamic))

    def _visit(self, name: str) -> list[str]:
        """Take a module into the result, and return the names that it imports and the packages around it."""
        top = name.partition(".")[0]
        if top == "zwerm" or (top in sys.stdlib_module_names and name != "__main__"):
            return []
        spec = spec_of(name)
        origin = _main_file() if name == "__main__" else None if spec is None else spec.origin
        around = [name.rpartition(".")[0]] if "." in name else []
        if spec is None and name != "__main__":
            return []  # no module has this name: an attribute of a package, or an import that fails
        if origin is None:
            if spec is None or spec.submodule_search_locations is None:
                self.unknown[f"module {name!r} has no file"] = None
            return around
        if origin in _BUILT_IN or _is_below(origin, _standard_folders(), but=_package_folders()):
            return []
        if _is_below(origin, _package_folders()) and top not in {each.partition(".")[0] for each in self.named}:
            installed = _version_of(top)
            if installed is not None:
                self.versions[installed] = None
                return []
        self.files[name] = SourceFile(name, origin, digest_of(origin))
        return [*around, *self._imports(name, origin, spec)]

    def _imports(self, name: str, origin: str, spec: ModuleSpec | None) -> list[str]:
        if not origin.endswith(".py"):
            if not origin.endswith((".so", ".pyd")):
                self.unknown[f"module {name!r} has no source in {origin}"] = None
            return []
        try:
            tree = ast.parse(Path(origin).read_bytes())
        except (OSError, SyntaxError, ValueError):
            return []
        is_package = spec is not None and spec.submodule_search_locations is not None
        package = name if is_package else name.rpartition(".")[0]
        found = []
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                found += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                found += list(_imported_from(node, package))
                if node.names[0].name == "*":  # a package may then import what its __all__ names
                    self.dynamic[name] = None
            elif isinstance(node, ast.Call):
                found += self._called(node, name)
        return found

    def _called(self, node: ast.Call, name: str) -> list[str]:
        """Return the module that a call imports by a literal name; note other ways to run code."""
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if called in _RUN_CODE:
            self.unknown[f"module {name!r} runs code by {called}, line {node.lineno}"] = None
        elif called in _IMPORT:
            first = node.args[0] if node.args else None
            if isinstance(first, ast.Constant) and isinstance(first.value, str):
                return [first.value.lstrip(".")]
            self.dynamic[name] = None
        return []


def _imported_from(node: ast.ImportFrom, package: str) -> Iterator[str]:
    """Yield the module of a from-import, and each name imported as it may be a submodule."""
    base = node.module or ""
    if node.level:
        parts = package.split(".") if package else []
        above = ".".join(parts[: len(parts) - node.level + 1])
        base = f"{above}.{base}".strip(".")
    if base:
        yield base
        yield from (f"{base}.{alias.name}" for alias in node.names if alias.name != "*")


def _main_file() -> str | None:
    return getattr(sys.modules.get("__main__"), "__file__", None)


def _is_below(path: str, folders: Sequence[str], but: Sequence[str] = ()) -> bool:
    """Return whether a path is in one of the folders and in none of `but`."""
    return path.startswith(tuple(folders)) and not (but and path.startswith(tuple(but)))


@cache
def _standard_folders() -> tuple[str, ...]:
    """Return the folders of the standard library, each with a separator at its end."""
    return tuple(dict.fromkeys(f"{sysconfig.get_path(each)}/" for each in ("stdlib", "platstdlib")))


@cache
def _package_folders() -> tuple[str, ...]:
    """Return the folders of installed distributions, each with a separator at its end."""
    known = [sysconfig.get_path(each) for each in ("purelib", "platlib")]
    known += [each for each in sys.path if Path(each).name in ("site-packages", "dist-packages")]
    return tuple(dict.fromkeys(f"{each}/" for each in known))


@cache
def _version_of(top: str) -> str | None:
    """Return the distribution of a package and its version, or None where no distribution is known to have it."""
    for distribution in packages_distributions().get(top, ()):
        try:
            return f"{distribution} {version(distribution)}"
        except PackageNotFoundError:
            continue
    return None
