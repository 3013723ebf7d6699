"""The private directory of a run, for sockets and passwords. No directory outlives its run for long.

A run removes its directory when it ends. A killed run cannot do this, but the kernel releases the lock that it held. The
next run on this machine removes all unlocked directories.
"""

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from zwerm.errors import LinkError

_PREFIX: Final = "zwerm-"
_HELD: Final = "held"

# The path of a Unix socket has at most 107 bytes, on macOS 103.
_SOCKET_PATH_BYTES_MAX: Final = 100


@contextlib.contextmanager
def private_directory() -> Iterator[Path]:
    """Make a directory that only its owner can enter, with a path short enough for a socket in it; remove it afterwards."""
    home = _short_directory()
    sweep(home)
    with tempfile.TemporaryDirectory(prefix=_PREFIX, dir=home, ignore_cleanup_errors=True) as name:
        path = Path(name)
        with (path / f".{_HELD}").open("wb") as held:
            fcntl.flock(held, fcntl.LOCK_EX)
            (path / f".{_HELD}").rename(path / _HELD)  # other runs see the file only after it is locked
            yield path


def sweep(home: Path) -> None:
    """Remove the private directories in `home` of killed runs."""
    for path in home.glob(f"{_PREFIX}*/{_HELD}"):
        with contextlib.suppress(OSError):  # of another user, locked, or removed meanwhile
            if path.parent.stat(follow_symlinks=False).st_uid == os.geteuid():
                with path.open("rb") as held:
                    fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(path.parent)


def _short_directory() -> Path:
    """Return the directory for temporary files, or /tmp if the path of a socket below it would be too long.

    Raises LinkError where no directory for temporary files can be written to.
    """
    try:
        chosen = tempfile.gettempdir()
    except FileNotFoundError as error:
        raise LinkError(f"{error.strerror}: set TMPDIR to a folder that can be written to") from None
    return Path(chosen if len(chosen) < _SOCKET_PATH_BYTES_MAX - len("/zwerm-12345678/listener-12345678") else "/tmp")
