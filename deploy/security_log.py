"""The security log of a run: one JSON object a line for each refusal, by the world or by its router, and at the end the counts.

A line has `time` (UTC), `node` (null where nobody can know it), `reason` and `detail`. The last line has `counts`, by node and
reason. So many lines of one node and reason are written, then only counted: an attacker cannot fill the disk.
"""

import contextlib
import fcntl
import os
import threading
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import msgspec

from zwerm.deploy.router_messages import RouterCounts
from zwerm.errors import ScenarioError

LINES_MAX: Final = 1_000
UNKNOWN_NODE: Final = -1
_MODE: Final = 0o600


class SecurityLog:
    """Writes a new file at `path`, for its owner only; with `router` also what this process's Zenoh router refuses.

    Raises ScenarioError if the file cannot be written. `note` may be called in any thread.
    """

    def __init__(self, path: Path, router: bool) -> None:
        self.error = ""  # why the log is incomplete
        self._path = path
        self._counts: dict[int, Counter[str]] = {}
        self._lock = threading.Lock()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(path, os.O_WRONLY | os.O_CREAT, _MODE)
        except OSError as error:
            raise ScenarioError([f"{path}: cannot write a security log: {error.strerror}"]) from None
        self._file = os.fdopen(descriptor, "wb", buffering=0)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise ScenarioError([f"{path}: cannot write a security log: another run is writing to it"]) from None
        except OSError:  # this file system has no locks
            pass
        with contextlib.suppress(OSError):  # a device
            self._file.truncate(0)
        self.router: RouterCounts | None = RouterCounts(note=self.note) if router else None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def note(self, node: int, reason: str, detail: str = "") -> None:
        """Write a refusal of what `node` did or tried; -1 where the node is not known."""
        with self._lock:
            counts = self._counts.setdefault(node, Counter())
            counts[reason] += 1
            if counts[reason] <= LINES_MAX:
                known = None if node == UNKNOWN_NODE else node
                self._write({"node": known, "reason": reason, "detail": detail})

    def close(self) -> None:
        """Write the counts, and close the file; idempotent."""
        if self.router is not None:
            self.router.close()
        with self._lock:
            if not self._file.closed:
                self._write({"counts": counts_by_name(self._counts)})
                with contextlib.suppress(OSError):
                    self._file.close()

    def _write(self, line: dict[str, Any]) -> None:
        if self.error or self._file.closed:
            return
        time = datetime.now(UTC).isoformat(timespec="milliseconds")
        try:
            self._file.write(msgspec.json.encode({"time": time, **line}) + b"\n")
        except OSError as error:
            self.error = f"{self._path}: the security log is incomplete: {error.strerror}"


def counts_by_name(counts: dict[int, Counter[str]]) -> dict[str, dict[str, int]]:
    """Return counts by node and reason for JSON; the key is `unknown` where the node is not known."""
    return {"unknown" if node == UNKNOWN_NODE else str(node): dict(counts[node]) for node in sorted(counts)}
