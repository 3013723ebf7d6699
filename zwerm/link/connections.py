"""Closes the connections of sessions that have no business with the router: unknown ids, and nodes that were evicted.

Zenoh admits a session by its user name and password, under any Zenoh id, has no setting against that, and closes no
session on request. Such a session has no rights, but each of its messages costs the router time. Zenoh reports new links with
the id and the address of the other end. The router's sockets are descriptors of this process, so it shuts one down. A
session that connects again is closed again.

Connections of TCP and TLS are known by their address. A Unix socket has none, but Linux tells which process has connected:
each robot of this machine may connect once. QUIC has one socket for all sessions: there a session stays.
"""

import contextlib
import os
import socket
import stat
import struct
import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator
from ipaddress import ip_address
from pathlib import Path
from typing import Final

import zenoh

_PROTOCOLS: Final = ("tcp", "tls")
_UNIX: Final = "unixsock-stream"
_PEER: Final = struct.Struct("3i")  # process, user and group

Address = tuple[str, int]


class Connections:
    """The links of a router's session. `admits` tells whether a session with this Zenoh id may stay.

    `processes` returns the ids of all processes of robots that may connect to a Unix socket; without it none is closed there.
    `on_cut` is called with the id of each session whose connection is closed, in a thread of Zenoh's callbacks.
    """

    def __init__(
        self,
        session: zenoh.Session,
        admits: Callable[[str], bool],
        on_cut: Callable[[str], object],
        processes: Callable[[], Collection[int]] | None = None,
    ) -> None:
        self._admits = admits
        self._on_cut = on_cut
        self._processes = processes
        self._banned: set[int] = set()  # processes that connected twice
        self._lock = threading.Lock()
        self._addresses: dict[str, Address] = {}  # by Zenoh id
        self._listener = session.info.declare_link_events_listener(self._on_event, history=True)

    def cut(self, session: str) -> None:
        """Close the connection of the session with this Zenoh id, if it has one with an address."""
        with self._lock:
            address = self._addresses.get(session)
        if address is not None and shut_down([address]):
            self._on_cut(session)

    def _on_event(self, event: zenoh.LinkEvent) -> None:
        """Keep the address of a link, or close it. Runs in a thread of its own."""
        session, source, address = str(event.link.zid), str(event.link.src), address_in(str(event.link.dst))
        with self._lock:
            if event.kind == zenoh.SampleKind.DELETE:
                if self._addresses.get(session) == address:
                    self._addresses.pop(session, None)
                return
            if address is not None:
                self._addresses[session] = address
        if self._admits(session):
            return
        if address is not None:
            self.cut(session)
            return
        local = self._processes is not None and source.startswith(f"{_UNIX}/") and sys.platform == "linux"
        if local and self._cut_strangers(source.removeprefix(f"{_UNIX}/")):
            self._on_cut(session)

    def _cut_strangers(self, path: str) -> int:
        """Close the connections to a Unix socket of all but this process and robots that connected once."""
        robots = set() if self._processes is None else set(self._processes())
        # Of each process, by the inode of the socket: a socket may have several descriptors, also for a moment.
        connections: dict[int, dict[int, socket.socket]] = defaultdict(dict)
        with contextlib.ExitStack() as stack:
            for each in own_sockets((socket.AF_UNIX,)):
                stack.enter_context(each)
                with contextlib.suppress(OSError):  # not connected
                    if each.getsockname() == path:
                        connections[process_of(each)][os.fstat(each.fileno()).st_ino] = each
            self._banned |= {process for process, own in connections.items() if process in robots and len(own) > 1}
            strangers = sorted(set(connections) - {os.getpid(), 0} - (robots - self._banned))
            for each in (each for process in strangers for each in connections[process].values()):
                with contextlib.suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)
        return len(strangers)


def process_of(connection: socket.socket) -> int:
    """Return the process that has connected to a Unix socket, 0 for a socket that listens. Raises OSError."""
    connection.getpeername()
    process: int = _PEER.unpack(connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))[0]
    return process


def address_in(locator: str) -> Address | None:
    """Return the IP address and the port that a locator of TCP or TLS names, such as "tls/[::1]:7447"; None for others."""
    protocol, _, rest = locator.partition("/")
    host, colon, port = rest.partition("?")[0].partition("#")[0].rpartition(":")
    if protocol not in _PROTOCOLS or not colon or not port.isdecimal():
        return None
    try:
        return _plain(host.strip("[]")), int(port)
    except ValueError:
        return None


def shut_down(addresses: Collection[Address]) -> int:
    """Shut down this process's connections from these addresses, and return how many there were."""
    count = 0
    for connection in own_sockets((socket.AF_INET, socket.AF_INET6)):
        with connection, contextlib.suppress(OSError, ValueError):  # not connected, or another thread closes it
            host, port = connection.getpeername()[:2]
            if (_plain(host), port) in addresses:
                connection.shutdown(socket.SHUT_RDWR)
                count += 1
    return count


def own_sockets(families: Collection[int]) -> Iterator[socket.socket]:
    """Yield copies of this process's stream sockets of these families."""
    for path in list(Path("/dev/fd").iterdir()):
        with contextlib.suppress(OSError):  # the descriptor of the listing is closed; another thread may close one
            number = int(path.name)
            if stat.S_ISSOCK(os.fstat(number).st_mode):
                copy = socket.socket(fileno=os.dup(number))
                if copy.type == socket.SOCK_STREAM and copy.family in families:
                    yield copy
                else:
                    copy.close()


def _plain(host: str) -> str:
    """Return an IP address in its plain form: without a zone, and that of IPv4 where it is mapped. Raises ValueError."""
    address = ip_address(host.partition("%")[0])
    return str(getattr(address, "ipv4_mapped", None) or address)
