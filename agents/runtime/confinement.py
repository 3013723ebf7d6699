"""Confinement of robot processes by the operating system: a user of its own, no network, limits of memory and processes.

A controller gets what its user may do. So a robot with a user of its own cannot read the files of other users, end or trace
other processes, or read the memory of the world. User and network need root and Linux. The limit of memory needs neither.
"""

import ctypes
import os
import resource
import sys
from pathlib import Path
from typing import Final

from msgspec import Struct

from zwerm.errors import ControllerError, LinkError

MEBIBYTE: Final = 2**20
_NEW_NETWORK: Final = 0x40000000  # CLONE_NEWNET

# The largest user id that Linux has; larger ones have other meanings.
_USER_MAX: Final = 2**31 - 2


class Confinement(Struct, frozen=True):
    """What the operating system keeps from every robot; None for no limit.

    Robot N runs as the user and group id `first_user` + N; with a connection by file system, in a network namespace without
    interfaces. It may allocate `memory_mb` MiB more than it has when it joins. Robot and children may have `processes`
    processes and threads more than then; this needs `first_user`, because the system counts by user.
    """

    first_user: int | None = None
    memory_mb: int | None = None
    processes: int | None = None

    def check(self) -> None:
        """Raise LinkError in one line where this machine or this user cannot do so."""
        if sys.platform != "linux" and self != UNCONFINED:
            raise LinkError(f"limits of robots need Linux, this is {sys.platform}")
        if self.processes is not None and self.first_user is None:
            raise LinkError("a limit of processes needs a user for each robot: the system counts processes by user")
        if self.first_user is not None:
            if not 0 < self.first_user <= _USER_MAX:
                raise LinkError(f"expected a first user id of 1 to {_USER_MAX}, got {self.first_user}")
            if os.geteuid() != 0:
                raise LinkError("a user for each robot needs root")

    def leave_network(self) -> None:
        """Move this process, which has one thread yet, into a network namespace without interfaces. Raises LinkError."""
        if self.first_user is not None and ctypes.CDLL(None, use_errno=True).unshare(_NEW_NETWORK):
            raise LinkError(f"cannot make a network namespace: {os.strerror(ctypes.get_errno())}")

    def apply(self, node: int) -> None:
        """Set the limits of this process, which is that of `node`, and take on its user. Raises ControllerError."""
        try:
            if self.memory_mb is not None:
                _lower(resource.RLIMIT_DATA, _data_bytes() + self.memory_mb * MEBIBYTE)
            if self.processes is not None:
                _lower(resource.RLIMIT_NPROC, len(list(Path("/proc/self/task").iterdir())) + self.processes)
            if self.first_user is not None:
                user = self.first_user + node
                os.setgroups([])
                os.setresgid(user, user, user)
                os.setresuid(user, user, user)
        except (OSError, ValueError) as error:
            raise ControllerError(f"the robot cannot be confined: {error}") from None


UNCONFINED: Final = Confinement()


def _lower(limit: int, value: int) -> None:
    """Set a limit, soft and hard, unless it is lower already."""
    _, hard = resource.getrlimit(limit)
    value = value if hard == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(limit, (value, value))


def _data_bytes() -> int:
    """Return the private writable memory that this process has mapped: what RLIMIT_DATA bounds (Linux)."""
    _, _, _, _, _, data, _ = map(int, Path("/proc/self/statm").read_text().split())
    return data * resource.getpagesize()
