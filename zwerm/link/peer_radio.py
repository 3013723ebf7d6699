"""The radio of a node on a real network, and the log of packets sent, arrived and received.

In the twin of a run packets do not pass the world. Each node has a Zenoh session of its own, in a network namespace, with a
direct link to every other node over UDP or TCP. A broadcast is one message to each node. The twin measures the behaviour of
Zenoh, the transport and the network, so this module neither repeats nor orders messages.

Nodes connect before the run: each sends hello until it has received hello from all nodes and all have received its own. Only
then may the network lose packets, because Zenoh opens a UDP link with messages that it does not repeat.
"""

import contextlib
import ctypes
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from struct import Struct as Layout
from typing import Final, Literal, NamedTuple

import zenoh
from msgspec import Struct
from zenoh.handlers import Callback

from zwerm.errors import LinkError
from zwerm.link.session import LEASE_LOCAL_MS, open_session
from zwerm.wire.keys import air_key, hail_key
from zwerm.wire.messages import Packet, Transmission

Transport = Literal["udp", "tcp"]

PORT: Final = 7447
EVERYONE: Final = 0xFFFF
HAIL_EVERY_S: Final = 0.05

_NEW_NETWORK: Final = 0x40000000  # CLONE_NEWNET

# Header of a packet: channel, sender, packet number, tick, and time of sending [ns].
_HEAD: Final = Layout(">BHIIQ")
HEAD_BYTES: Final = _HEAD.size

# Record of the log: event, channel, other node, packet number, tick and time of sending [ns], time of the event.
_LINE: Final = Layout(">BBHIIQQ")
MET, SENT, ARRIVED, HEARD = range(4)


class Station(Struct, frozen=True):
    """A node's network namespace and addresses. `receives_from` are (channel, sender); sender "*" means all of a channel."""

    node: int
    namespace: str
    transport: Transport
    addresses: dict[int, str]
    channels: tuple[str, ...]
    receives_from: tuple[tuple[str, str], ...]
    anonymous: tuple[str, ...]
    log: str


class LogLine(NamedTuple):
    """One record of a log. `at` is the machine's monotonic clock [ns]; for HEARD it is a tick."""

    what: int
    channel: int
    other: int
    number: int
    tick: int
    sent_ns: int
    at: int


def read_log(path: Path) -> Iterator[LogLine]:
    """Yield the complete records of a log; a killed process may leave an incomplete last one."""
    content = path.read_bytes() if path.exists() else b""
    whole = len(content) - len(content) % _LINE.size
    return map(LogLine._make, _LINE.iter_unpack(content[:whole]))


def enter_namespace(path: str) -> None:
    """Move the calling thread, and threads that it starts later, into the network namespace at `path`.

    Raises LinkError if the kernel refuses.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.setns(descriptor, _NEW_NETWORK):
            raise LinkError(f"{path}: cannot enter the network namespace: {os.strerror(ctypes.get_errno())}")
    finally:
        os.close(descriptor)


class PeerRadio:
    """The radio of the node at `station` in the run `run`."""

    def __init__(self, run: str, station: Station) -> None:
        """Open the session, and start to send hello. Raises LinkError if the network cannot be used."""
        self._station = station
        self._log = Path(station.log).open("ab", buffering=0)  # noqa: SIM115 - closed with the radio
        self._arrived: deque[tuple[int, int, int, bytes]] = deque()
        self._number = 0
        self._met: dict[int, bool] = {}  # nodes received from, and whether they have received from this node
        self._meeting = threading.Event()
        node, transport = station.node, station.transport
        places = {other: f"{transport}/{address}:{PORT}" for other, address in station.addresses.items()}
        self._session = open_session(
            {
                "mode": "peer",
                "listen/endpoints": [places[node]],
                # One link a pair: the node with the larger id connects.
                "connect/endpoints": [place for other, place in sorted(places.items()) if other < node],
                "connect/retry": {"period_init_ms": 50, "period_max_ms": 200},
                "transport/link/tx/lease": LEASE_LOCAL_MS,
            },
            f"node {node} at {places[node]}",
        )
        self._put: dict[str, Callable[[bytes], None]] = {}
        self._run = run
        for channel, sender in station.receives_from:
            for key in (air_key(run, channel, sender), air_key(run, channel, sender, node)):
                self._subscribe(key, self._on_packet)
        self._subscribe(hail_key(run, "*"), self._on_hail)
        self._caller = threading.Thread(target=self._hail, name="zwerm-hail", daemon=True)
        self._caller.start()

    def begin(self) -> None:
        """Stop sending hello: the run begins."""
        self._meeting.set()

    def send(self, tick: int, message: Transmission) -> None:
        """Send a packet to all nodes on its channel, or to its receiver."""
        to = EVERYONE if message.to is None else message.to
        channel, now_ns = self._station.channels.index(message.channel), time.monotonic_ns()
        self._note(SENT, channel, to, self._number, tick, now_ns, now_ns)
        frame = _HEAD.pack(channel, self._station.node, self._number, tick, now_ns) + message.payload
        self._number += 1
        self._publisher(air_key(self._run, message.channel, self._station.node, message.to))(frame)

    def take(self, tick: int) -> tuple[Packet, ...]:
        """Return the arrived packets that were sent before `tick`, in the order of arrival."""
        packets: list[Packet] = []
        kept: list[tuple[int, int, int, bytes]] = []
        while self._arrived:
            arrival = channel, sender, sent_tick, frame = self._arrived.popleft()
            if sent_tick >= tick:  # from a node that is ahead: a packet takes at least one tick
                kept.append(arrival)
                continue
            _, _, number, _, sent_ns = _HEAD.unpack_from(frame)
            self._note(HEARD, channel, sender, number, sent_tick, sent_ns, tick)
            name = self._station.channels[channel]
            packets.append(Packet(name, frame[HEAD_BYTES:], None if name in self._station.anonymous else sender))
        self._arrived.extendleft(reversed(kept))
        return tuple(packets)

    def close(self) -> None:
        """Stop, and close the log.

        The session stays open until the process ends: Zenoh waits for a closing message, which a blocked link loses.
        """
        self._meeting.set()
        self._caller.join()
        self._log.close()

    def _subscribe(self, key: str, on_sample: Callable[[zenoh.Sample], None]) -> None:
        self._session.declare_subscriber(key, Callback(on_sample, indirect=False), allowed_origin=zenoh.Locality.REMOTE)

    def _publisher(self, key: str) -> Callable[[bytes], None]:
        put = self._put.get(key)
        if put is None:
            put = self._put[key] = self._session.declare_publisher(
                key,
                express=True,
                congestion_control=zenoh.CongestionControl.DROP,  # a radio drops packets instead of waiting
                reliability=zenoh.Reliability.BEST_EFFORT,
                allowed_destination=zenoh.Locality.REMOTE,
            ).put
        return put

    def _on_packet(self, sample: zenoh.Sample) -> None:
        frame, now_ns = sample.payload.to_bytes(), time.monotonic_ns()
        channel, sender, number, tick, sent_ns = _HEAD.unpack_from(frame)
        with contextlib.suppress(ValueError):  # the log is closed
            self._note(ARRIVED, channel, sender, number, tick, sent_ns, now_ns)
        self._arrived.append((channel, sender, tick, frame))

    def _on_hail(self, sample: zenoh.Sample) -> None:
        sender, *met = sample.payload.to_bytes()
        self._met[sender] = self._station.node in met

    def _hail(self) -> None:
        """Send the ids received from, repeatedly. Log MET when this node has received from all and all from it."""
        others, noted = len(self._station.addresses) - 1, False
        hail = self._publisher(hail_key(self._run, self._station.node))
        while True:
            met = dict(self._met)
            if not noted and len(met) == others and all(met.values()):
                noted = True
                self._note(MET, 0, 0, 0, 0, 0, time.monotonic_ns())
            with contextlib.suppress(zenoh.ZError):
                hail(bytes([self._station.node, *sorted(met)]))
            if self._meeting.wait(HAIL_EVERY_S):
                return

    def _note(self, what: int, channel: int, other: int, number: int, tick: int, sent_ns: int, at: int) -> None:
        self._log.write(_LINE.pack(what, channel, other, number, tick, sent_ns, at))
