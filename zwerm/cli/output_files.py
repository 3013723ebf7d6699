"""The files that a command writes: checked before the work begins, named so that one run does not overwrite another."""

import os
import re
import shutil
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Final, NamedTuple

from zwerm.errors import ScenarioError

PICTURES: Final = (".png", ".pdf", ".svg")
ANIMATIONS: Final = (".gif", ".mp4")
RECORDINGS: Final = (".mcap",)
ROWS: Final = (".parquet", ".csv")

_SLUG_CHARS_MAX: Final = 80


class OutputFile(NamedTuple):
    """A file that an option asks for, the suffixes it may have, and the package and its extra that writing it needs."""

    option: str
    path: Path | None
    suffixes: tuple[str, ...]
    package: str = ""
    extra: str = ""


def check_outputs(files: Sequence[OutputFile]) -> None:
    """Raise ScenarioError with a line for every file that cannot be written; files without a path are left out."""
    found = [
        f"{file.option}: {mistake}" for file in files if file.path is not None for mistake in _mistakes(file, file.path)
    ]
    if found:
        raise ScenarioError(found)


def _mistakes(file: OutputFile, path: Path) -> list[str]:
    suffix, found = path.suffix.lower(), []
    if suffix not in file.suffixes:
        found.append(f"{path}: expected a file that ends in {' or '.join(file.suffixes)}")
    elif suffix == ".mp4" and shutil.which("ffmpeg") is None:
        found.append(f"{path}: an .mp4 needs ffmpeg, which is not installed; choose a .gif")
    if file.package and find_spec(file.package) is None:
        found.append(f"{path}: needs {file.package}: pip install 'zwerm[{file.extra}]'")
    folder = next((each for each in path.absolute().parents if each.exists()), Path("/"))
    if path.is_dir():
        found.append(f"{path}: is a folder")
    elif not folder.is_dir():
        found.append(f"{path}: {folder} is no folder")
    elif not os.access(path if path.exists() else folder, os.W_OK):
        found.append(f"{path}: no permission to write {'it' if path.exists() else f'in {folder}'}")
    return found


def run_stem(name: str, seed: int, overrides: Sequence[str] = ()) -> str:
    """Return the name of a run's files, without a suffix: scenario, seed and settings."""
    slug = "-".join(re.sub(r"[^A-Za-z0-9.=_+-]+", "-", each).strip("-") for each in overrides)
    if len(slug) > _SLUG_CHARS_MAX:
        from hashlib import blake2b  # 10 ms that most commands do not need

        slug = f"{slug[:_SLUG_CHARS_MAX]}-{blake2b(repr(overrides).encode(), digest_size=4).hexdigest()}"
    return f"{name}-seed{seed}" + (f"-{slug}" if slug else "")
