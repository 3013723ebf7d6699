"""A session that has no business with the router is cut off, and others stay: over TCP, where the router's sockets tell."""

import contextlib
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import msgspec
import pytest
from frame_proxy import FrameProxy
from network import NIL, RUN, Network, network, network_over_tcp
from support import ROOT
from waiting import until

from zwerm.deploy.identity import issue
from zwerm.errors import LinkError
from zwerm.link import Arrival
from zwerm.link.admission import ExpectedNode
from zwerm.link.connections import STREAMS, address_in, own_sockets, process_of, shut_down
from zwerm.link.session import Credential, trust_settings

VICTIM, OTHER = 0, 1


@pytest.fixture
def net(private_tmp: Path) -> Iterator[Network]:
    with network_over_tcp(private_tmp) as opened:
        yield opened


@pytest.mark.parametrize(
    ("locator", "address"),
    [
        ("tcp/127.0.0.1:7447", ("127.0.0.1", 7447)),
        ("tls/[::1]:7447", ("::1", 7447)),
        ("tcp/[::ffff:10.0.0.1]:80", ("10.0.0.1", 80)),
        ("tcp/[fe80::1%eth0]:80", ("fe80::1", 80)),
        ("tcp/10.0.0.1:80?rel=0#iface=eth0", ("10.0.0.1", 80)),
        ("quic/127.0.0.1:7447", None),
        ("unixsock-stream/4296c661-eb1a", None),
        ("tcp/localhost:80", None),
        ("tcp/127.0.0.1:", None),
        ("tcp/127.0.0.1", None),
        ("", None),
    ],
)
def test_a_locator_of_tcp_and_tls_names_an_address(locator: str, address: tuple[str, int] | None) -> None:
    assert address_in(locator, STREAMS) == address


@pytest.mark.parametrize(("family", "host"), [(socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")])
def test_only_the_connection_from_an_address_is_shut_down(family: socket.AddressFamily, host: str) -> None:
    with socket.create_server((host, 0), family=family) as server:
        address = server.getsockname()[:2]
        with socket.create_connection(address) as one, socket.create_connection(address) as two:
            ends = [server.accept()[0] for _ in range(2)]
            assert shut_down([(host, one.getsockname()[1])]) == 1
            one.settimeout(20.0)
            assert one.recv(1) == b"", "the other end sees the end of the connection"
            ends[1].sendall(b"x")
            assert two.recv(1) == b"x", "the other connection works"
            for end in ends:
                end.close()


linux = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a socket does not tell who has connected")


def is_cut_off(net: Network, proxy: FrameProxy, times: int) -> bool:
    return proxy.ended and net.link.refusals.by_reason["cut-off"] >= times


def test_a_session_with_a_stolen_password_and_another_id_is_cut_off_whenever_it_connects(net: Network) -> None:
    stolen = msgspec.structs.replace(net.credentials.nodes[VICTIM], zid="abc")
    with closing(net.node(VICTIM)) as victim:
        victim.join()
        for times in (1, 2):
            with (
                FrameProxy(int(net.endpoint.rpartition(":")[2])) as proxy,
                net._replace(endpoint=proxy.endpoint).session(stolen),
            ):
                until(partial(is_cut_off, net, proxy, times), "the session was cut off")
        victim.send(b"real")
        assert net.link.receive(20.0) == Arrival(VICTIM, b"real")
        assert net.link.refusals.by_node.keys() == {-1}


def test_by_tls_a_session_with_a_stolen_certificate_and_another_id_is_cut_off_whenever_it_connects(
    private_tmp: Path,
) -> None:
    with network_over_tcp(private_tmp, encrypted=True) as net:
        terms = net.credentials.terms
        stolen = msgspec.structs.replace(net.credentials.nodes[VICTIM], zid="abc")
        with closing(net.node(VICTIM, terms=terms)) as victim:
            victim.join()
            for _ in range(10):
                # It may be closed before it is open at the other end.
                with contextlib.suppress(LinkError), net.session(stolen, **trust_settings(stolen, terms)) as session:
                    until(lambda: not session.info.transports(), "the session was closed")
            until(lambda: net.link.refusals.by_reason["cut-off"] >= 2, "they were counted")
            victim.send(b"real")
            assert net.link.receive(20.0) == Arrival(VICTIM, b"real")
            assert net.link.refusals.by_node.keys() == {-1}


@linux
def test_by_quic_what_a_session_with_a_stolen_certificate_and_another_id_sends_is_dropped(private_tmp: Path) -> None:
    with network_over_tcp(private_tmp, encrypted=True, protocol="quic") as net:
        terms = net.credentials.terms
        stolen = msgspec.structs.replace(net.credentials.nodes[VICTIM], zid="abc")
        with closing(net.node(VICTIM, terms=terms)) as victim:
            victim.join()
            for _ in range(2):
                # The router closes a session from which nothing comes for its lease.
                short = trust_settings(stolen, terms) | {"transport/link/tx/lease": 1_000}
                with contextlib.suppress(LinkError), net.session(stolen, **short) as session:
                    until(lambda: not session.info.transports(), "the session ended")
            until(lambda: net.link.refusals.by_reason["cut-off"] >= 2, "they were counted")
            victim.send(b"real")
            assert net.link.receive(20.0) == Arrival(VICTIM, b"real")
            assert net.link.refusals.by_node.keys() == {-1}


def test_an_evicted_node_is_cut_off_and_no_other(net: Network) -> None:
    with closing(net.node(VICTIM)) as victim, closing(net.node(OTHER)) as other:
        victim.join()
        other.join()
        net.link.evict(OTHER)
        assert net.link.wait_joined(lambda joined: OTHER not in joined, 20.0), "its connection has ended"
        assert net.link.receive(20.0) == Arrival(OTHER, None)
        victim.send(b"real")
        assert net.link.receive(20.0) == Arrival(VICTIM, b"real")
        until(lambda: net.link.refusals.by_node.get(OTHER, {}).get("cut-off", 0) >= 1, "it was counted")
        assert VICTIM not in net.link.refusals.by_node


SESSION = """
import sys, time
from network import RUN
from zwerm.link.session import open_session
from zwerm.wire.keys import alive_key, hello_key
from zwerm.wire.messages import Hello, encode
endpoint, user, password, zid, named = sys.argv[1:]
settings = {"mode": "client", "id": zid, "connect/endpoints": [endpoint]}
session = open_session(settings | {"transport/auth/usrpwd": {"user": user, "password": password}}, "refused")
if named:
    token = session.liveliness().declare_token(alive_key(RUN, 0))
    answers = list(session.get(hello_key(RUN, 0), payload=encode(Hello(0, 1, process=int(named)))))
while session.info.transports():
    time.sleep(0.01)
"""


def session_of_a_process(
    net: Network, credential: Credential, zid: str, named: int | None = None
) -> "subprocess.Popen[str]":
    """Start a process that opens a session with this Zenoh id, and ends when that is cut off.

    With `named` it joins as node 0 of that process.
    """
    told = "" if named is None else str(named)
    return subprocess.Popen(
        [sys.executable, "-c", SESSION, net.endpoint, credential.user, credential.password, zid, told],
        env=os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "tests/helpers")))},
        text=True,
    )


@linux
def test_on_a_unix_socket_another_process_with_a_stolen_password_is_cut_off(private_tmp: Path) -> None:
    credentials = issue(RUN, range(3))
    members = {each.node: ExpectedNode(1, "nobody", NIL, session=each.zid) for each in credentials.nodes}
    with network(private_tmp, members=members, credentials=credentials, processes=list) as net:
        stolen = credentials.nodes[VICTIM]
        with closing(net.node(VICTIM)) as victim:
            victim.join()
            assert session_of_a_process(net, stolen, "abc").wait(60) == 0
            until(lambda: net.link.refusals.by_reason["cut-off"] >= 1, "it was counted")
            victim.send(b"real")
            assert net.link.receive(20.0) == Arrival(VICTIM, b"real")


@contextlib.contextmanager
def network_of_one(directory: Path) -> Iterator[Network]:
    """Open the link of a world that did not start its only node, over a Unix socket."""
    credentials = issue(RUN, range(1))
    members = {each.node: ExpectedNode(1, "nobody", NIL, session=each.zid) for each in credentials.nodes}
    with network(directory, 1, members, credentials=credentials) as net:
        yield net


@linux
def test_of_robots_started_elsewhere_another_process_is_cut_off_as_soon_as_all_have_joined(private_tmp: Path) -> None:
    with network_of_one(private_tmp) as net, closing(net.node(VICTIM)) as victim:
        stolen = net.credentials.nodes[VICTIM]
        with session_of_a_process(net, stolen, "abc") as early:
            until(lambda: has_connected(early.pid), "it has connected")
            victim.join()
            assert early.wait(60) == 0
        assert session_of_a_process(net, stolen, "def").wait(60) == 0
        until(lambda: net.link.refusals.by_reason["cut-off"] >= 2, "they were counted")
        victim.send(b"real")
        assert net.link.receive(20.0) == Arrival(VICTIM, b"real")


@linux
@pytest.mark.parametrize("named", [0, 2**22 + 1], ids=["no process", "one of a container"])
def test_no_robot_is_cut_off_whose_process_is_not_known_here(private_tmp: Path, named: int) -> None:
    """No process has an id above 2**22. The node that joins is of another process: the world's own one is never cut off."""
    with network_of_one(private_tmp) as net, contextlib.ExitStack() as stack:
        own = net.credentials.nodes[VICTIM]

        def start(zid: str, named: int | None = None) -> "subprocess.Popen[str]":
            process = stack.enter_context(session_of_a_process(net, own, zid, named))
            stack.callback(process.kill)
            return process

        robot = start(own.zid, named)
        assert net.link.wait_joined(lambda joined: VICTIM in joined, 60.0)
        copies = [stack.enter_context(each) for each in connections_from(robot.pid)]
        thief = start("abc")
        until(lambda: has_connected(thief.pid), "it has connected")
        until(lambda: len(vars(net.link._connections)["_links"]) == 2, "the router has told of it")
        assert not any(is_shut_down(each) for each in copies)
        assert thief.poll() is None


@linux
def test_a_robot_whose_connection_has_two_descriptors_is_not_taken_for_two(private_tmp: Path) -> None:
    """Another thread may copy descriptors at the same time."""
    credentials = issue(RUN, range(2))
    members = {each.node: ExpectedNode(1, "nobody", NIL, session=each.zid) for each in credentials.nodes}
    robots: list[int] = []
    with network(private_tmp, 2, members, credentials=credentials, processes=lambda: robots) as net:
        own = credentials.nodes[OTHER]
        with session_of_a_process(net, own, own.zid) as robot, contextlib.ExitStack() as stack:
            robots.append(robot.pid)
            stack.callback(robot.kill)
            until(lambda: has_connected(robot.pid), "the robot has connected")
            copies = [stack.enter_context(each) for each in connections_from(robot.pid)]
            assert session_of_a_process(net, credentials.nodes[VICTIM], "abc").wait(60) == 0
            assert robot.poll() is None
            assert not any(is_shut_down(each) for each in copies)


def has_connected(process: int) -> bool:
    with contextlib.ExitStack() as stack:
        return bool([stack.enter_context(each) for each in connections_from(process)])


def is_shut_down(connection: socket.socket) -> bool:
    try:
        return connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT) == b""
    except BlockingIOError:  # there is nothing to read
        return False


def connections_from(process: int) -> list[socket.socket]:
    """Return copies of this process's connections from another one by a Unix socket."""
    found = []
    for each in own_sockets((socket.AF_UNIX,)):
        with contextlib.suppress(OSError):  # not connected
            if process_of(each) == process:
                found.append(each)
                continue
        each.close()
    return found
