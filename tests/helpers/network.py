"""A world's end of a link with access control, and sessions of well-behaved and of hostile nodes, for tests."""

import contextlib
import socket
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import zenoh

from zwerm.deploy.authority import certify
from zwerm.deploy.identity import WorldIdentity, issue, router_settings
from zwerm.link import Arrival, WorldLink
from zwerm.link.admission import ExpectedNode
from zwerm.link.node_link import ZenohNodeLink
from zwerm.link.session import TWO_THREADS, Credential, Credentials, open_session, set_threads
from zwerm.link.world_link import ZenohWorldLink
from zwerm.wire.keys import hello_key
from zwerm.wire.messages import Hello, Observation, encode

RUN = "test"
NIL = b"\xc0"


class Network(NamedTuple):
    """The world's link, and the credentials of its nodes."""

    link: ZenohWorldLink
    credentials: Credentials
    endpoint: str

    def node(self, number: int, **options: Any) -> ZenohNodeLink:
        """Return the connected end of a well-behaved node that has not joined yet."""
        return ZenohNodeLink(RUN, self.credentials.nodes[number], self.endpoint, deadline_s=20.0, **options)

    def session(self, credential: Credential | None, **settings: Any) -> zenoh.Session:
        """Return a raw Zenoh session, with a credential or without one."""
        identity = {}
        if credential is not None:
            identity = {
                "id": credential.zid,
                "transport/auth/usrpwd": {"user": credential.user, "password": credential.password},
            }
        return open_session(
            {
                "mode": "client",
                "connect/endpoints": [self.endpoint],
                "connect/timeout_ms": 1000,
                "connect/exit_on_failure": True,
                **identity,
                **settings,
            },
            "no session",
        )


@contextlib.contextmanager
def network_over_tcp(directory: Path, *, encrypted: bool = False, protocol: str = "tls") -> Iterator[Network]:
    """Open a world's link at a free TCP port, as `network` does, which knows the session of each of three nodes.

    If it is `encrypted`, by TLS or QUIC, the world and each node have a certificate.
    """
    identity, credentials = None, issue(RUN, range(3))
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    if encrypted:
        identity, credentials = certify(credentials, ["localhost"])
        endpoint = f"{protocol}/localhost:{free_port()}"
    members = {each.node: ExpectedNode(1, "nobody", NIL, session=each.zid) for each in credentials.nodes}
    with network(directory, members=members, endpoint=endpoint, credentials=credentials, identity=identity) as opened:
        yield opened


@contextlib.contextmanager
def network(
    directory: Path,
    nodes: int = 3,
    members: Mapping[int, ExpectedNode] | None = None,
    endpoint: str = "",
    credentials: Credentials | None = None,
    processes: Callable[[], Collection[int]] | None = None,
    identity: WorldIdentity | None = None,
) -> Iterator[Network]:
    """Open a world's link that expects `members` (all `nodes`, if None) and has credentials for all `nodes`."""
    set_threads(TWO_THREADS)
    endpoint = endpoint or f"unixsock-stream/{directory}/router"
    credentials = credentials or issue(RUN, range(nodes))
    if members is None:
        members = {node: ExpectedNode(1, "nobody", NIL) for node in range(nodes)}
    settings = router_settings(credentials, [endpoint], directory / "passwords", identity)
    link = ZenohWorldLink(RUN, members, settings, processes)
    try:
        yield Network(link, credentials, endpoint)
    finally:
        link.close()


def ask(session: zenoh.Session, node: int, payload: bytes) -> list[bytes]:
    """Send hello on the key of `node`, and return the answers."""
    replies = session.get(hello_key(RUN, node), zenoh.handlers.FifoChannel(8), payload=payload, timeout=5.0)
    return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]


def hello(node: int, incarnation: int = 1) -> bytes:
    """Return an encoded hello."""
    return encode(Hello(node, incarnation))


def tick(link: WorldLink, nodes: range, number: int) -> dict[int, Arrival]:
    """Send every node an observation, and return what arrives, by node."""
    for node in nodes:
        link.send(node, encode(Observation(number, 0.0)))
    arrivals = [link.receive(20.0) for _ in nodes]
    return {arrival.node: arrival for arrival in arrivals if arrival is not None}


def free_port() -> int:
    """Return a port of this machine without a TCP listener; most probably without a UDP one."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
