"""Faults of the environment of a command: a place where it runs, and a function for each fault that changes such a place."""

import contextlib
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from tests.helpers.waiting import until

ROOT: Final = Path(__file__).parents[2]
TMPFS_BYTES: Final = 1 << 20
LEFT_BYTES: Final = 8_192  # of a full disk, so that files can be made, and not be filled
LONG_CHARS: Final = 90
DESCRIPTORS: Final = 256
MANY: Final = 30
OTHER_USER: Final = "61300"


@dataclass(frozen=True)
class Place:
    """Where and how a command runs.

    Its working directory, its folder for temporary files, changes of its environment ("" removes a variable), and the words
    before the command, and more after it. `begin` is called once the command runs, with a function that tells whether a run
    has begun elsewhere.
    """

    here: Path
    temporary: Path
    changes: dict[str, str] = field(default_factory=dict)
    before: tuple[str, ...] = ()
    more: tuple[str, ...] = ()
    begin: Callable[[Callable[[], bool]], object] = bool

    @property
    def environment(self) -> dict[str, str]:
        """The environment of the command."""
        found = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "120", "TMPDIR": str(self.temporary)} | self.changes
        return {name: value for name, value in found.items() if value}

    def start(self, *arguments: str) -> "subprocess.Popen[str]":
        """Start `zwerm ARGUMENTS`, the leader of a session."""
        python = (sys.executable,) if "python" not in self.changes else (self.changes["python"],)
        return subprocess.Popen(
            [*self.before, *python, "-c", "from zwerm.cli.app import main; main()", *arguments, *self.more],
            cwd=self.here,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )


@contextlib.contextmanager
def mounted(folder: Path, *options: str) -> Iterator[None]:
    """Mount a small file system in memory on a folder."""
    size = ",".join((f"size={TMPFS_BYTES}", *options))
    subprocess.run(["mount", "-t", "tmpfs", "-o", size, "tmpfs", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@contextlib.contextmanager
def full(folder: Path) -> Iterator[None]:
    """Let `folder` be on a disk with LEFT_BYTES left."""
    kept = {path.name: path.read_bytes() for path in folder.iterdir()}
    with mounted(folder):
        for name, content in kept.items():
            (folder / name).write_bytes(content)
        with (folder / "fill").open("wb", buffering=0) as filler, contextlib.suppress(OSError):
            while filler.write(bytes(4_096)):
                pass
        os.truncate(folder / "fill", (folder / "fill").stat().st_size - LEFT_BYTES)
        yield


# --- the faults -----------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def no_fault(place: Place) -> Iterator[Place]:
    """Change nothing."""
    yield place


@contextlib.contextmanager
def full_disk(place: Place) -> Iterator[Place]:
    """Fill the disk below the working directory."""
    with full(place.here):
        yield place


@contextlib.contextmanager
def full_temporary(place: Place) -> Iterator[Place]:
    """Fill the disk below the folder for temporary files completely."""
    with full(place.temporary):
        with contextlib.suppress(OSError), (place.temporary / "more").open("wb", buffering=0) as filler:
            while filler.write(bytes(4_096)):
                pass
        yield place


@contextlib.contextmanager
def read_only(place: Place) -> Iterator[Place]:
    """Let the working directory be on a read-only file system."""
    kept = (place.here / "study.toml").read_bytes()
    with mounted(place.here):
        (place.here / "study.toml").write_bytes(kept)
        subprocess.run(["mount", "-o", "remount,ro", str(place.here)], check=True)
        yield place


@contextlib.contextmanager
def no_home(place: Place) -> Iterator[Place]:
    """Let HOME and the folders for settings and caches be unset."""
    yield replace(place, changes=dict.fromkeys(("HOME", "MPLCONFIGDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"), ""))


@contextlib.contextmanager
def missing_home(place: Place) -> Iterator[Place]:
    """Let HOME be a folder that nobody can make."""
    yield replace(place, changes={"HOME": "/proc/nobody", "MPLCONFIGDIR": ""})


@contextlib.contextmanager
def long_path(place: Place) -> Iterator[Place]:
    """Let the folder for temporary files have a path of LONG_CHARS characters."""
    long = place.temporary / ("x" * (LONG_CHARS - len(str(place.temporary)) - 1))
    long.mkdir()
    yield replace(place, temporary=long)


@contextlib.contextmanager
def few_descriptors(place: Place) -> Iterator[Place]:
    """Allow each process DESCRIPTORS descriptors."""
    yield replace(place, before=("prlimit", f"--nofile={DESCRIPTORS}:{DESCRIPTORS}"))


@contextlib.contextmanager
def too_few_descriptors(place: Place) -> Iterator[Place]:
    """Allow each process DESCRIPTORS descriptors, and ask for MANY robots."""
    with few_descriptors(place) as limited:
        yield replace(limited, more=("--set", f"robots.count={MANY}"))


@contextlib.contextmanager
def other_user(place: Place) -> Iterator[Place]:
    """Run as a user without a name and a home, in a folder of its own.

    The interpreter may be in a folder that only root can enter: a mount that only this command sees makes it reachable.
    """
    python = place.temporary.parent / "python"
    python.mkdir()
    python.parent.chmod(0o755)
    for folder in (place.here, place.temporary):
        os.chown(folder, int(OTHER_USER), int(OTHER_USER))
    user = f"setpriv --reuid {OTHER_USER} --regid {OTHER_USER} --clear-groups"
    entered = f'mount --bind -o ro {sys.base_prefix} {python} && exec {user} "$@"'
    changes = {
        "python": str(python / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}"),
        "PYTHONPATH": f"{ROOT}:{sysconfig.get_path('purelib')}",
        "PYTHONDONTWRITEBYTECODE": "1",
        "LD_LIBRARY_PATH": str(python / "lib"),
        "HOME": "",
        "MPLCONFIGDIR": "",
    }
    yield replace(place, changes=changes, before=("unshare", "--mount", "sh", "-c", entered, "sh"))


@contextlib.contextmanager
def folder_of_another(place: Place) -> Iterator[Place]:
    """Run as another user in a folder in which it may not write."""
    with other_user(place) as other:
        os.chown(place.here, 0, 0)
        yield other


@contextlib.contextmanager
def deleted_before(place: Place) -> Iterator[Place]:
    """Delete the working directory before the command starts."""
    shutil.rmtree(place.here)
    place.here.mkdir()
    script = f'cd "{place.here}" && rmdir "{place.here}" && exec "$@"'
    yield replace(place, here=place.temporary, before=("sh", "-c", script, "sh"))


@contextlib.contextmanager
def deleted_later(place: Place) -> Iterator[Place]:
    """Delete the working directory as soon as the command has made a file in it."""

    def delete(begun: Callable[[], bool]) -> None:
        known = set(place.here.iterdir())
        until(lambda: begun() or set(place.here.iterdir()) - known, "the command makes a file")
        shutil.rmtree(place.here, ignore_errors=True)

    yield replace(place, begin=delete)
