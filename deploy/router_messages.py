"""The router's own messages about what it refused: denied operations, wrong passwords, messages that are too long,
connections that speak another protocol.

Zenoh reports these only in its log, which it writes to descriptor 1. `capture` moves the standard output of this process to
another descriptor, and reads Zenoh's log in a thread. This holds until the process ends, because Zenoh's log cannot be
switched off again. The log has a line for each message that the router carries: the world
needs up to twice the processor time (measured with 30 robots in lock-step).
"""

import contextlib
import os
import queue
import re
import sys
import threading
from collections.abc import Callable
from typing import Final, NamedTuple

import zenoh

from zwerm.wire.refusals import Refusals

# What Zenoh's log holds: every decision of the access control and its effect, failed handshakes, and discarded messages.
_FILTER: Final = ",".join(
    (
        "zenoh::net::routing::interceptor=trace",
        "zenoh_transport::unicast::establishment::accept=debug",
        "zenoh_transport::unicast::manager=trace",
        "zenoh_transport::unicast::universal::rx=trace",
    )
)

DENIED: Final = "denied"
FOREIGN: Final = "foreign-session"
PASSWORD: Final = "password"
OVERSIZED: Final = "oversized"
SILENT: Final = "silent"
FULL: Final = "full"
HANDSHAKE: Final = "handshake"

# A text in a line of the log, and the reason of the refusal that it reports.
_TEXTS: Final = (
    (b"Invalid password", PASSWORD),
    (b"Invalid user", PASSWORD),
    (b"Expected extension", PASSWORD),
    (b"did not match any configured ACL subject", FOREIGN),
    (b"Defragmentation buffer full", OVERSIZED),
    (b"Failed to accept link before deadline", SILENT),
    (b"Decode error on link", HANDSHAKE),
    (b"Received invalid message instead of an ", HANDSHAKE),
    (b"Rejecting InitSyn on ", HANDSHAKE),
    (b"Rejecting OpenSyn on", HANDSHAKE),
    (b"Decoding cookie failed", HANDSHAKE),
    (b"Max transports reached", FULL),
    (b"Closing link for preventing potential DoS", FULL),
)

_CACHING: Final = re.compile(rb"ACL \(ingress\): caching permissions for `([^`]*)`")
_DENIAL: Final = re.compile(rb"(Using cached result: )?(\S+)(?: on (.*?))? is unauthorized to (.+) \(ingress\) on (.*)")
_USER: Final = re.compile(rb"Username\(node-(\d+)\)")
_DROPPED: Final = b"zenoh::net::routing::interceptor: Msg intercepted!"
_THREAD: Final = re.compile(rb"ThreadId\((\d+)\)")
_DROPPED_OF_FOREIGN: Final = "a message of a session that has no permissions"

# Bytes of the log that one read takes, and the longest time that reading all of it may take [s].
_READ_BYTES: Final = 1 << 18
SETTLE_S_MAX: Final = 30.0


class RouterEvent(NamedTuple):
    """One refusal by the router: its reason, the node if the router knows it (else -1), and what was tried."""

    reason: str
    node: int
    detail: str


class RefusalParser:
    """Finds refusals in the lines of Zenoh's log.

    When the router first meets a key, it evaluates all operations on it in advance, and logs each result as if it had been
    tried. The parser skips one such line for each operation that follows the announcement of a key. A message that is dropped
    without a line before it, by the same thread, is that of a session without permissions: the router does not say which.
    Keys and session ids are what a session chose to send: a hostile one can add false lines, but cannot take back true ones.
    """

    def __init__(self) -> None:
        # Which node a session belongs to that the log has not named, -1 for none.
        self.node_of_session: Callable[[str], int] = lambda session: -1
        self._key = b""
        self._evaluated: set[bytes] = set()
        self._node_of: dict[bytes, int] = {}  # by session
        self._deciding: set[bytes] = set()  # threads whose newest line denies an operation

    def parse(self, line: bytes) -> RouterEvent | None:
        """Return the refusal that a line reports, or None."""
        if b"unauthorized" in line:
            self._deciding |= _threads_of(line)
            return self._denial(line)
        if line.endswith(_DROPPED):
            known = self._deciding & _threads_of(line)
            self._deciding -= known
            return None if known else RouterEvent(DENIED, -1, _DROPPED_OF_FOREIGN)
        if announced := _CACHING.search(line):
            self._key, self._evaluated = announced[1], set()
            return None
        if b" is authorized" in line or b"Received: " in line:  # most lines; a payload may hold any text
            return None
        for text, reason in _TEXTS:
            if text in line:
                return RouterEvent(reason, -1, text.decode())
        return None

    def _denial(self, line: bytes) -> RouterEvent | None:
        found = _DENIAL.search(line)
        if found is None:  # towards a node: the router withholds what the node must not see
            return None
        cached, session, subject, operation, key = found.groups()
        if user := _USER.search(subject or b""):
            self._node_of[session] = int(user[1])
        if not cached and key == self._key and operation not in self._evaluated:
            self._evaluated.add(operation)
            return None
        tried = f"session {_text(session)}: {_text(operation)} on {_text(key)}"
        node = self._node_of.get(session)
        return RouterEvent(DENIED, self.node_of_session(_text(session)) if node is None else node, tried)


def _threads_of(line: bytes) -> set[bytes]:
    """Return the thread that wrote a line of the log."""
    return {found[1]} if (found := _THREAD.search(line)) else set()


def _text(part: bytes) -> str:
    return part[:200].decode("utf-8", "replace")


class RouterMessages:
    """Zenoh's log of this process, read in a thread of its own. `on_event` is called there with each refusal."""

    def __init__(self) -> None:
        self.on_event: Callable[[RouterEvent], object] | None = None
        self.parser = RefusalParser()
        self._settled: queue.SimpleQueue[None] = queue.SimpleQueue()  # Ctrl-C cannot leave it locked, unlike an Event
        reader, writer = os.pipe()
        sys.stdout.flush()
        if _is_descriptor_1(sys.stdout):
            sys.stdout = os.fdopen(os.dup(1), "w", encoding=sys.stdout.encoding)
        os.dup2(writer, 1)
        os.close(writer)
        before = {name: os.environ.get(name) for name in ("RUST_LOG", "NO_COLOR")}
        os.environ |= {"RUST_LOG": _FILTER, "NO_COLOR": "1"}
        zenoh.init_log_from_env_or(_FILTER)
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value
        threading.Thread(target=self._read, args=(reader,), name="zwerm-router-messages", daemon=True).start()

    def settle(self) -> None:
        """Return when everything that Zenoh has logged so far was read."""
        with contextlib.suppress(queue.Empty):  # left by a call that did not wait until the end
            self._settled.get_nowait()
        os.write(1, b"\n" + _SETTLE + b"\n")
        with contextlib.suppress(queue.Empty):
            self._settled.get(timeout=SETTLE_S_MAX)

    def _read(self, reader: int) -> None:
        rest = b""
        while block := os.read(reader, _READ_BYTES):
            *lines, rest = (rest + block).split(b"\n")
            for line in lines:
                if line == _SETTLE:
                    self._settled.put(None)
                elif (event := self.parser.parse(line)) is not None and self.on_event is not None:
                    self.on_event(event)


class RouterCounts:
    """Counts what this process's router refuses, by node and reason, from now on. `note` is called with each refusal.

    `node_of_session` tells which joined node a Zenoh id belongs to, -1 for none. It names sessions that began before.
    """

    def __init__(
        self,
        node_of_session: Callable[[str], int] | None = None,
        note: Callable[[int, str, str], object] = lambda node, reason, detail: None,
    ) -> None:
        self._refusals = Refusals()
        self._note = note
        self._messages = capture()
        if node_of_session is not None:
            self._messages.parser.node_of_session = node_of_session
        self._messages.on_event = self._on_event

    def denials(self) -> dict[int, int]:
        """Return the number of operations that the router has denied to each known node so far."""
        return {node: reasons.get(DENIED, 0) for node, reasons in self._refusals.by_node.items() if node >= 0}

    def settled(self) -> Refusals:
        """Return the counts of all that the router has refused so far."""
        if self._messages.on_event is not None:
            self._messages.settle()
        return self._refusals

    def close(self) -> None:
        """Count no more; idempotent."""
        if self._messages.on_event is not None:
            self._messages.settle()
            self._messages.on_event = None

    def _on_event(self, event: RouterEvent) -> None:
        self._refusals.count(event.node, event.reason)
        self._note(event.node, event.reason, event.detail)


_SETTLE: Final = b"zwerm: everything before this line was read"
_capturing: RouterMessages | None = None


def capture() -> RouterMessages:
    """Begin to read Zenoh's log in this process, before its first session opens. The same object every time."""
    global _capturing
    if _capturing is None:
        _capturing = RouterMessages()
    return _capturing


def _is_descriptor_1(stream: object) -> bool:
    try:
        return stream.fileno() == 1  # type: ignore[attr-defined, no-any-return]
    except (AttributeError, OSError, ValueError):
        return False
