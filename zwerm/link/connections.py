"""Closes the connections of sessions that have no business with the router: unknown ids, and nodes that were evicted.

Zenoh admits a session by its user name and password, under any Zenoh id, has no setting against that, and closes no
session on request. Such a session has no rights, but each of its messages costs the router time. Zenoh reports new links with
the id and the address of the other end. The router's sockets are descriptors of this process, so it shuts one down. A
session that connects again is closed again.

Connections of TCP and TLS are known by their address. QUIC has one socket for all sessions: there the kernel drops what comes
from the address, until the session has ended. A Unix socket has no address, but Linux tells which process has connected: each
process of a robot may connect once.
"""

import contextlib
import os
import socket
import stat
import struct
import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from ipaddress import ip_address
from pathlib import Path
from typing import Final, NamedTuple

import zenoh

from zwerm.link.datagram_filter import drop_datagrams

STREAMS: Final = ("tcp", "tls")
DATAGRAMS: Final = ("quic",)
_UNIX: Final = "unixsock-stream/"
_PEER: Final = struct.Struct("3i")  # process, user and group

Address = tuple[str, int]


class _Link(NamedTuple):
    """The locators of both ends of a session's link."""

    own: str
    other: str


class Connections:
    """The links of a router's session. `admits` tells whether a session with this Zenoh id may stay.

    `processes` returns the ids of the processes that may connect to a Unix socket, and how often each may. While it returns
    None, none is closed there. `on_cut` is called with the id of each session whose connection is closed, mostly in a thread of
    Zenoh's callbacks.
    """

    def __init__(
        self,
        session: zenoh.Session,
        admits: Callable[[str], bool],
        on_cut: Callable[[str], object],
        processes: Callable[[], Mapping[int, int] | None],
    ) -> None:
        self._admits = admits
        self._on_cut = on_cut
        self._processes = processes
        self._banned: set[int] = set()  # processes that connected too often
        self._lock = threading.Lock()
        self._links: dict[str, _Link] = {}  # by Zenoh id
        self._dropped: dict[str, _Link] = {}  # links of QUIC that the kernel filters, by Zenoh id, the newest last
        self._listener = session.info.declare_link_events_listener(self._on_event, history=True)

    def cut(self, session: str) -> None:
        """Close the connection of the session with this Zenoh id, if it has one that can be closed."""
        with self._lock:
            link = self._links.get(session)
        if link is not None and self._close(session, link):
            self._on_cut(session)

    def cut_foreign(self) -> None:
        """Close the connections of all sessions that may not stay, as far as they can be closed."""
        with self._lock:
            sessions = list(self._links)
        for session in sessions:
            if not self._admits(session):
                self.cut(session)

    def is_local(self, session: str) -> bool:
        """Return whether the session with this Zenoh id has connected to a Unix socket."""
        with self._lock:
            link = self._links.get(session)
        return link is not None and link.own.startswith(_UNIX)

    def _on_event(self, event: zenoh.LinkEvent) -> None:
        """Keep a link, or close it. Runs in a thread of its own."""
        session, link = str(event.link.zid), _Link(str(event.link.src), str(event.link.dst))
        with self._lock:
            if event.kind == zenoh.SampleKind.DELETE:
                if self._links.get(session) == link:
                    del self._links[session]
                if self._dropped.get(session) == link:
                    del self._dropped[session]
                    self._filter(link)
                return
            self._links[session] = link
        if not self._admits(session):
            self.cut(session)

    def _close(self, session: str, link: _Link) -> bool:
        """Close a connection; return whether there was one to close."""
        if (address := address_in(link.other, STREAMS)) is not None:
            return shut_down([address]) > 0
        if address_in(link.other, DATAGRAMS) is not None:
            with self._lock:
                self._dropped[session] = link
                return self._filter(link)
        return sys.platform == "linux" and link.own.startswith(_UNIX) and self._cut_strangers(link.own)

    def _filter(self, link: _Link) -> bool:
        """Let the kernel drop what comes to the own end of a link from all links that it shall drop there."""
        own = address_in(link.own, DATAGRAMS)
        sources = [address_in(each.other, DATAGRAMS) for each in self._dropped.values() if each.own == link.own]
        done = False
        for each in own_sockets((socket.AF_INET, socket.AF_INET6), socket.SOCK_DGRAM):
            with each, contextlib.suppress(OSError):
                if own is not None and each.getsockname()[1] == own[1]:
                    done |= drop_datagrams(each, [source for source in sources if source is not None])
        return done

    def _cut_strangers(self, locator: str) -> bool:
        """Close the connections to a Unix socket of all but this process and those that may connect; return whether any was."""
        allowed = self._processes()
        if allowed is None:
            return False
        path = locator.removeprefix(_UNIX)
        # Of each process, by the inode of the socket: a socket may have several descriptors, also for a moment.
        connections: dict[int, dict[int, socket.socket]] = defaultdict(dict)
        with contextlib.ExitStack() as stack:
            for each in own_sockets((socket.AF_UNIX,)):
                stack.enter_context(each)
                with contextlib.suppress(OSError):  # not connected
                    if each.getsockname() == path:
                        connections[process_of(each)][os.fstat(each.fileno()).st_ino] = each
            self._banned |= {
                process for process, own in connections.items() if len(own) > allowed.get(process, len(own))
            }
            strangers = sorted(set(connections) - {os.getpid(), 0} - (allowed.keys() - self._banned))
            for each in (each for process in strangers for each in connections[process].values()):
                with contextlib.suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)
        return bool(strangers)


def connected_processes() -> set[int]:
    """Return the processes that have connected to Unix sockets of this one."""
    found: set[int] = set()
    for each in own_sockets((socket.AF_UNIX,)):
        with each, contextlib.suppress(OSError):  # not connected
            found.add(process_of(each))
    return found


def process_of(connection: socket.socket) -> int:
    """Return the process that has connected to a Unix socket, 0 for a socket that listens. Raises OSError."""
    connection.getpeername()
    process: int = _PEER.unpack(connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))[0]
    return process


def address_in(locator: str, protocols: Collection[str]) -> Address | None:
    """Return the IP address and the port that a locator of one of these protocols names; None for others.

    A locator is such as "tls/[::1]:7447".
    """
    protocol, _, rest = locator.partition("/")
    host, colon, port = rest.partition("?")[0].partition("#")[0].rpartition(":")
    if protocol not in protocols or not colon or not port.isdecimal():
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


def own_sockets(families: Collection[int], kind: int = socket.SOCK_STREAM) -> Iterator[socket.socket]:
    """Yield copies of this process's sockets of these families and this kind."""
    for path in list(Path("/dev/fd").iterdir()):
        with contextlib.suppress(OSError):  # the descriptor of the listing is closed; another thread may close one
            number = int(path.name)
            if stat.S_ISSOCK(os.fstat(number).st_mode):
                copy = socket.socket(fileno=os.dup(number))
                if copy.type == kind and copy.family in families:
                    yield copy
                else:
                    copy.close()


def _plain(host: str) -> str:
    """Return an IP address in its plain form: without a zone, and that of IPv4 where it is mapped. Raises ValueError."""
    address = ip_address(host.partition("%")[0])
    return str(getattr(address, "ipv4_mapped", None) or address)
