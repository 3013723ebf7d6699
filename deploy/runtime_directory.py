"""Private directories of a run, for sockets and the like: gone when the run is, however it ended.

A run that ends removes its own. One that was killed cannot: but it held a lock that the kernel has let go of, and the next run
on this machine removes what nobody holds any more.
"""

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

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
            (path / f".{_HELD}").rename(path / _HELD)  # whoever sees it finds it locked
            yield path


def sweep(home: Path) -> None:
    """Remove the private directories in `home` whose runs were killed."""
    for path in home.glob(f"{_PREFIX}*/{_HELD}"):
        with contextlib.suppress(OSError):  # somebody else's, or gone meanwhile
            if path.parent.stat(follow_symlinks=False).st_uid == os.geteuid():
                with path.open("rb") as held:
                    fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(path.parent)


def _short_directory() -> Path:
    """Return the directory for temporary files, or /tmp where a socket below it would have too long a path."""
    chosen = tempfile.gettempdir()
    return Path(chosen if len(chosen) < _SOCKET_PATH_BYTES_MAX - len("/zwerm-12345678/router") else "/tmp")
