"""A filter drops the datagrams of the given sources, whatever their family, and no others."""

import socket
import sys

import pytest

from zwerm.link.datagram_filter import ADDRESSES_MAX, drop_datagrams

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="filters of sockets are Linux's")

HOSTS = [
    (socket.AF_INET, "127.0.0.1", "127.0.0.1"),
    (socket.AF_INET6, "::1", "::1"),
    (socket.AF_INET6, "::", "127.0.0.1"),
]


def bound(family: socket.AddressFamily, host: str) -> socket.socket:
    found = socket.socket(family, socket.SOCK_DGRAM)
    if family == socket.AF_INET6:
        found.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
    found.bind((host, 0))
    found.settimeout(20.0)
    return found


@pytest.mark.parametrize(("family", "host", "peer"), HOSTS)
def test_the_datagrams_of_a_source_are_dropped_and_those_of_others_arrive(
    family: socket.AddressFamily, host: str, peer: str
) -> None:
    peers = socket.AF_INET6 if ":" in peer else socket.AF_INET
    with bound(family, host) as receiver, bound(peers, peer) as bad, bound(peers, peer) as good:
        target, banned = (peer, receiver.getsockname()[1]), [("192.0.2.1", 9), ("2001:db8::1", 9)]
        assert drop_datagrams(receiver, [*banned, (peer, bad.getsockname()[1])])
        bad.sendto(b"bad", target)
        good.sendto(b"good", target)
        assert receiver.recv(9) == b"good"
        assert drop_datagrams(receiver, banned)
        bad.sendto(b"admitted again", target)
        assert receiver.recv(99) == b"admitted again"


def test_the_last_of_too_many_sources_are_dropped() -> None:
    with bound(socket.AF_INET, "127.0.0.1") as receiver, bound(socket.AF_INET, "127.0.0.1") as sender:
        source, target = ("127.0.0.1", sender.getsockname()[1]), receiver.getsockname()
        others = [(f"2001:db8::{number:x}", number) for number in range(ADDRESSES_MAX)]
        assert drop_datagrams(receiver, [*others, source])
        sender.sendto(b"dropped", target)
        assert drop_datagrams(receiver, [source, *others])
        sender.sendto(b"arrives", target)
        assert receiver.recv(9) == b"arrives"


def test_what_is_no_address_is_refused() -> None:
    with bound(socket.AF_INET, "127.0.0.1") as receiver, pytest.raises(ValueError, match="localhost"):
        drop_datagrams(receiver, [("localhost", 80)])
