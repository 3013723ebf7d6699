"""A client that is not Zenoh's: its frames and its repeated handshakes gain no more than Zenoh's library would."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import msgspec
import pytest
from frame_proxy import FrameProxy, replay
from network import RUN, Network, ask, hello, network

from zwerm.link import Arrival
from zwerm.wire.keys import command_key, observation_key

VICTIM, INTRUDER = 0, 1
FRAMES, MESSAGES = 20, 50


@pytest.fixture
def net(private_tmp: Path) -> Iterator[Network]:
    with network(private_tmp) as opened:
        yield opened


def address_of(net: Network) -> str:
    return net.endpoint.partition("/")[2]


def captured(net: Network, proxy: FrameProxy) -> tuple[bytes, bytes]:
    """Return channel and bytes of a put that node INTRUDER sent on its own key, b"forged", over the proxy."""
    with net._replace(endpoint=proxy.endpoint).session(net.credentials.nodes[INTRUDER]) as session:
        ask(session, INTRUDER, hello(INTRUDER))
        session.put(command_key(RUN, INTRUDER), b"forged")
        assert net.link.receive(20.0) == Arrival(INTRUDER, b"forged")
        channel, message = proxy.message_with(b"forged")
        # Positive control: the router takes a frame of the proxy for one of the session.
        proxy.send(channel, message)
        assert net.link.receive(20.0) == Arrival(INTRUDER, b"forged")
    return channel, message


def test_frames_of_a_session_with_a_stolen_password_and_another_id_change_nothing(net: Network) -> None:
    with closing(net.node(VICTIM)) as victim:
        victim.join()
        with FrameProxy(address_of(net)) as proxy:
            channel, message = captured(net, proxy)
        own = command_key(RUN, INTRUDER).encode()
        assert own in message
        stolen = msgspec.structs.replace(net.credentials.nodes[VICTIM], zid="abc")
        with (
            FrameProxy(address_of(net)) as proxy,
            net._replace(endpoint=proxy.endpoint).session(stolen),
        ):
            for key in (command_key(RUN, VICTIM), command_key(RUN, INTRUDER)):
                for _ in range(FRAMES):
                    proxy.send(channel, message.replace(own, key.encode()) * MESSAGES)
            forged = message.replace(own, observation_key(RUN, VICTIM).encode())
            proxy.send(channel, forged * MESSAGES)
            proxy.close_session()
        victim.send(b"real")
        assert net.link.receive(20.0) == Arrival(VICTIM, b"real")
        net.link.send(VICTIM, b"an observation")
        assert victim.receive(20.0) == b"an observation"
    assert net.link.refusals.by_reason == {}


@pytest.mark.parametrize("fresh_cookie", [False, True])
def test_a_handshake_that_was_captured_opens_no_session(net: Network, fresh_cookie: bool) -> None:
    with FrameProxy(address_of(net)) as proxy:
        captured(net, proxy)
        assert len(proxy.handshake) == 2
    assert not replay(address_of(net), proxy.handshake, fresh_cookie=fresh_cookie)
    with closing(net.node(VICTIM)) as victim:
        assert victim.join().refused == ""
