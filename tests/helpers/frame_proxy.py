"""A client of a router that is not Zenoh's: it relays the connection of a session, and sends frames of its own in it.

Zenoh's library sends nothing of a session that may know no subscriber. An attacker with a library of its own is not bound
by that. The proxy counts the sequence numbers of the frames that it relays, so the router takes its own frames for those
of the session. It keeps the frames that the session sent, as a source of messages, and the messages of its handshake.

Layout of Zenoh's protocol, version 9: a batch is its length (2 bytes, little-endian) and transport messages. A frame is its
header, its sequence number, an extension where it has a priority of its own, and network messages. Numbers have seven bits
a byte, the lowest first.
"""

import contextlib
import socket
import struct
import threading
from collections.abc import Iterator
from typing import Final, NamedTuple, Self

_LENGTH: Final = struct.Struct("<H")
_TIME: Final = struct.Struct("ll")  # seconds and microseconds, as the kernel takes them
BATCH_BYTES_MAX: Final = 65_535
_ID_MASK: Final = 0x1F
INIT: Final = 0x01
OPEN: Final = 0x02
FRAME: Final = 0x05
_CLOSE: Final = bytes([0x03 | 0x20, 0])  # the whole session, for no special reason
_SIZES: Final = 0x40
_SIZES_BYTES: Final = 3
_EXTENDED: Final = 0x80
_SEQUENCE_MASK: Final = (1 << 28) - 1


class Frame(NamedTuple):
    """A frame: its channel (header and extensions), its sequence number, and the network messages in it."""

    channel: bytes
    number: int
    messages: bytes

    def encoded(self) -> bytes:
        """Return the frame as a batch without its length."""
        return self.channel[:1] + number_bytes(self.number) + self.channel[1:] + self.messages


def number_bytes(number: int) -> bytes:
    """Return a number in Zenoh's encoding."""
    found = bytearray()
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*found, number])


def read_number(data: bytes, at: int) -> tuple[int, int]:
    """Return the number that begins at an index of `data`, and the index behind it."""
    number = shift = 0
    while True:
        byte = data[at]
        number |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return number, at


def frame_of(batch: bytes) -> Frame | None:
    """Return the frame that a batch holds, or None."""
    if batch[0] & _ID_MASK != FRAME:
        return None
    number, at = read_number(batch, 1)
    begin = at
    more = bool(batch[0] & _EXTENDED)
    while more:  # extensions of a frame are numbers
        more = bool(batch[at] & _EXTENDED)
        _, at = read_number(batch, at + 1)
    return Frame(batch[:1] + batch[begin:at], number, batch[at:])


def first_number(open_syn: bytes) -> int:
    """Return the sequence number with which the frames of a session begin, from the message that opens it."""
    _, at = read_number(open_syn, 1)  # the lease
    return read_number(open_syn, at)[0]


def cookie_of(init_ack: bytes) -> bytes:
    """Return the cookie in the router's first answer: behind its version, its id and its sizes."""
    at = 3 + 1 + (init_ack[2] >> 4) + (_SIZES_BYTES if init_ack[0] & _SIZES else 0)
    length, at = read_number(init_ack, at)
    return init_ack[at : at + length]


def with_cookie(open_syn: bytes, cookie: bytes) -> bytes:
    """Return the message that opens a session, with another cookie."""
    _, at = read_number(open_syn, 1)
    _, at = read_number(open_syn, at)
    length, begin = read_number(open_syn, at)
    return open_syn[:at] + number_bytes(len(cookie)) + cookie + open_syn[begin + length :]


class FrameProxy:
    """Relays one connection to the router at `address`: a TCP port of this machine, or the path of a Unix socket.

    `endpoint` is where the session connects. `send` gives up after `wait_s` if the router reads nothing: a connection that it
    has shut down may stay blocked for longer.
    """

    def __init__(self, address: int | str, wait_s: int = 60) -> None:
        self._address = address
        self._wait_s = wait_s
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
        self.handshake: list[bytes] = []
        self.frames: list[Frame] = []
        self._next: dict[bytes, int] = {}  # sequence number of the next frame, by channel
        self._lock = threading.Lock()
        self._down = threading.Thread(target=self._relay_down, name="proxy-down", daemon=True)
        self._up = threading.Thread(target=self._relay_up, name="proxy-up", daemon=True)

    def __enter__(self) -> Self:
        self._up.start()
        return self

    def __exit__(self, *_: object) -> None:
        for each in (self._listener, *self._sockets()):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
        for thread in (self._up, self._down):
            if thread.ident is not None:
                thread.join()

    def message_with(self, text: bytes) -> tuple[bytes, bytes]:
        """Return channel and network messages of a frame that the session sent and that holds `text`.

        Raises LookupError where there is none.
        """
        for frame in list(self.frames):
            if text in frame.messages:
                return frame.channel, frame.messages
        raise LookupError(text)

    def send(self, channel: bytes, messages: bytes) -> None:
        """Send network messages in a frame of the session. Raises OSError where the router has closed the connection."""
        with self._lock:
            self._send(Frame(channel, self._next.get(channel, first_number(self.handshake[1])), messages))

    @property
    def ended(self) -> bool:
        """Whether the router has closed the connection of the session."""
        return self._down.ident is not None and not self._down.is_alive()

    def close_session(self) -> None:
        """End the session, and return when the router has read all frames and has closed the connection."""
        with self._lock:
            self._router.sendall(with_length(_CLOSE))
        self._down.join()

    def _send(self, frame: Frame) -> None:
        self._next[frame.channel] = frame.number + 1 & _SEQUENCE_MASK
        self._router.sendall(with_length(frame.encoded()))

    def _sockets(self) -> list[socket.socket]:
        return [each for name in ("_client", "_router") if (each := vars(self).get(name)) is not None]

    def _relay_up(self) -> None:
        with contextlib.suppress(OSError):  # closed
            self._client, _ = self._listener.accept()
            self._router = connection_to(self._address)
            self._router.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _TIME.pack(self._wait_s, 0))
            self._down.start()
            for batch in batches(self._client):
                self._relay(batch)

    def _relay(self, batch: bytes) -> None:
        frame = frame_of(batch)
        with self._lock:
            if frame is None:
                if batch[0] & _ID_MASK in (INIT, OPEN):
                    self.handshake.append(batch)
                self._router.sendall(with_length(batch))
                return
            self.frames.append(frame)
            self._send(frame._replace(number=self._next.get(frame.channel, frame.number)))

    def _relay_down(self) -> None:
        with contextlib.suppress(OSError):  # closed
            while block := self._router.recv(BATCH_BYTES_MAX):
                self._client.sendall(block)


def connection_to(address: int | str) -> socket.socket:
    """Return a connection to a TCP port of this machine, or to a Unix socket."""
    if isinstance(address, int):
        return socket.create_connection(("127.0.0.1", address))
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(address)
    return connection


def batches(connection: socket.socket) -> Iterator[bytes]:
    """Yield the batches that arrive at a connection until it ends."""
    with connection.makefile("rb") as stream:
        while len(head := stream.read(_LENGTH.size)) == _LENGTH.size:
            yield stream.read(*_LENGTH.unpack(head))


def with_length(batch: bytes) -> bytes:
    """Return a batch as it is sent."""
    return _LENGTH.pack(len(batch)) + batch


def replay(address: int | str, handshake: list[bytes], *, fresh_cookie: bool) -> bool:
    """Repeat the handshake of another session on a new connection, and return whether the router admits it.

    With `fresh_cookie` the second message bears the cookie of this connection, in place of the captured one.
    """
    with connection_to(address) as raw:
        answers = batches(raw)
        raw.sendall(with_length(handshake[0]))
        acknowledged = next(answers, b"")
        if not acknowledged:
            return False
        second = with_cookie(handshake[1], cookie_of(acknowledged)) if fresh_cookie else handshake[1]
        raw.sendall(with_length(second))
        answer = next(answers, b"")
        return bool(answer) and answer[0] & _ID_MASK == OPEN
