"""The world's end of a Zenoh link: a session that is itself the router, so that no message takes a detour.

Promises: only nodes that are expected and have been welcomed are heard, under one incarnation at a time; a node's
messages arrive in the order sent, and the end of its process after the last of them. What was turned away is counted
in `refused`. Who may connect, and speak on which key, is not decided here but by the access control in the router's
settings.

Messages wait in a channel on Zenoh's side and are taken out in the caller's own thread: a callback in Python for each
would compete with the world for the interpreter lock. As that channel has no wait with a timeout, an alarm rings
through it.
"""

import contextlib
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from typing import Any, Final

import msgspec
import zenoh
from msgspec import Struct

from zwerm.errors import LinkError
from zwerm.keys import EVERY, alive_key, command_key, hello_key, node_of, observation_key
from zwerm.link import Arrival
from zwerm.link.session import TWO_THREADS, open_session, set_threads
from zwerm.protocol import REFUSABLE, Goodbye, Welcome, decode_hello, encode, refusal

# More than can wait at once when every node answers each message with one; past it Zenoh holds the senders back.
CHANNEL_CAPACITY: Final = 16_384

# Stands in the place of a node id where the world writes to itself; access control leaves that key to nobody else.
BELL: Final = "bell"


class Member(Struct, frozen=True):
    """A node that the world expects: the incarnation it must present, its controller's name, its encoded Setup."""

    incarnation: int
    controller: str
    setup: bytes
    paced: bool = False


class ZenohWorldLink:
    """The world's end of the link to the nodes `members` of the run `run`, listening as `settings` say."""

    def __init__(self, run: str, members: Mapping[int, Member], settings: Mapping[str, Any]) -> None:
        """Open the router's session and wait for nobody. Raises LinkError where it cannot listen."""
        self.refused: Counter[str] = Counter()
        self._run = run
        self._members = dict(members)
        self._joined: dict[int, int] = {}
        self._source_of: dict[str, int] = {}
        self._changed = threading.Condition()
        self._dismissed = False
        set_threads(TWO_THREADS)
        self._session = open_session({"mode": "router", **settings}, "the world cannot listen")
        try:
            self._put = {node: self._publisher(observation_key(run, node)).put for node in self._members}
            self._bell_key = command_key(run, BELL)
            self._ring = self._publisher(self._bell_key, zenoh.Locality.SESSION_LOCAL).put
            self._messages = self._session.declare_subscriber(
                command_key(run, EVERY), zenoh.handlers.FifoChannel(CHANNEL_CAPACITY)
            )
            self._alarm = _Alarm(lambda: self._ring(b""))
            self._session.liveliness().declare_subscriber(alive_key(run, EVERY), self._on_life)
            self._session.declare_queryable(hello_key(run, EVERY), self._on_hello)
        except BaseException:
            self._session.close()  # type: ignore[no-untyped-call]
            raise

    @property
    def joined(self) -> frozenset[int]:
        """The nodes that have been welcomed and are not lost."""
        return frozenset(self._joined)

    def wait_joined(self, enough: Callable[[Collection[int]], bool], timeout_s: float) -> bool:
        """Wait until `enough` of the nodes joined is true; tell whether it was within `timeout_s` seconds."""
        with self._changed:
            return self._changed.wait_for(lambda: enough(self._joined.keys()), timeout_s)

    def expect(self, node: int, member: Member) -> None:
        """Let a node that is lost, or never joined, join as `member`. Raises LinkError for one that is joined."""
        with self._changed:
            if node in self._joined:
                raise LinkError(f"node {node} is still joined as incarnation {self._joined[node]}")
            self._members[node] = member
            if node not in self._put:
                self._put[node] = self._publisher(observation_key(self._run, node)).put

    def send(self, node: int, payload: bytes) -> None:
        """Send one message to a node that has joined."""
        self._put[node](payload)

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next arrival, or None after `timeout_s` seconds without one. Raises LinkError once closed."""
        deadline_s: float | None = None
        try:
            while True:
                sample = self._messages.try_recv()
                if sample is None:
                    if timeout_s <= 0:
                        return None
                    if deadline_s is None:
                        deadline_s = time.monotonic() + timeout_s
                    self._alarm.set(deadline_s)
                    sample = self._messages.recv()
                key = str(sample.key_expr)
                node = self._source_of.get(key)
                if node is not None:
                    return Arrival(node, sample.payload.to_bytes())
                if key != self._bell_key:
                    with self._changed:
                        self.refused["not-joined"] += 1
                    if timeout_s > 0 and _is_over(deadline_s := deadline_s or time.monotonic() + timeout_s):
                        return None  # whoever must not be heard must not hold us up either
                elif note := sample.payload.to_bytes():
                    return self._lost(note)
                elif deadline_s is not None and _is_over(deadline_s):
                    return None
        except zenoh.ZError as error:
            raise LinkError(f"the world's link is closed: {error}") from None

    def dismiss(self, reason: str) -> None:
        """Tell every joined node that its life is over; their leaving is no loss and is not reported."""
        self._dismissed = True
        if self._session.is_closed():
            return
        farewell = encode(Goodbye(reason))
        for node in sorted(self._joined):
            self._put[node](farewell)

    def close(self) -> None:
        """Release all that the link holds; idempotent."""
        self._dismissed = True
        self._alarm.close()
        self._session.close()  # type: ignore[no-untyped-call]

    def _publisher(self, key: str, destination: zenoh.Locality = zenoh.Locality.REMOTE) -> zenoh.Publisher:
        return self._session.declare_publisher(
            key, express=True, congestion_control=zenoh.CongestionControl.BLOCK, allowed_destination=destination
        )

    def _lost(self, note: bytes) -> Arrival:
        node, incarnation = msgspec.msgpack.decode(note, type=tuple[int, int])
        if self._joined.get(node, incarnation) == incarnation:
            self._source_of.pop(command_key(self._run, node), None)
        return Arrival(node, None)

    def _on_life(self, sample: zenoh.Sample) -> None:
        """A liveliness token came or vanished. Runs in a thread of its own."""
        if sample.kind == zenoh.SampleKind.PUT:
            return
        node = node_of(str(sample.key_expr))
        with self._changed:
            incarnation = self._joined.pop(node, None)
            self._changed.notify_all()
        if incarnation is not None and not self._dismissed:
            with contextlib.suppress(zenoh.ZError):  # closed meanwhile
                self._ring(encode((node, incarnation)))

    def _on_hello(self, query: zenoh.Query) -> None:
        """A node asks to join, or says goodbye. Runs in a thread of its own."""
        with query, contextlib.suppress(zenoh.ZError):  # closed meanwhile
            key = str(query.key_expr)
            try:
                welcome = self._welcome(node_of(key), query.payload.to_bytes() if query.payload else b"")
            except ValueError:
                welcome = Welcome(refused="identity")
            if welcome.refused:
                with self._changed:
                    self.refused[welcome.refused] += 1
            query.reply(key, encode(welcome))

    def _welcome(self, node: int, payload: bytes) -> Welcome:
        """Let the node join and say what it is, or say why not."""
        try:
            hello = decode_hello(payload)
        except REFUSABLE as error:
            return Welcome(refused=refusal(error).reason)
        with self._changed:
            if isinstance(hello, Goodbye):
                return Welcome(refused="" if node in self._joined else "not-joined")
            member = self._members.get(node)
            if hello.node != node:
                return Welcome(refused="identity")
            if member is None:
                return Welcome(refused="unknown")
            if hello.incarnation != member.incarnation:
                return Welcome(refused="incarnation")
            if node in self._joined:
                return Welcome(refused="joined")
            self._joined[node] = member.incarnation
            self._source_of[command_key(self._run, node)] = node
            self._changed.notify_all()
        return Welcome(controller=member.controller, setup=msgspec.Raw(member.setup), paced=member.paced)


def _is_over(deadline_s: float) -> bool:
    return time.monotonic() >= deadline_s


class _Alarm:
    """Calls `ring` once the time set last has come; also, harmlessly, at times when nobody waits for it any more."""

    def __init__(self, ring: Callable[[], None]) -> None:
        self._ring = ring
        self._changed = threading.Condition()
        self._due_s: float | None = None
        self._wakes_s = float("inf")
        self._open = True
        self._thread = threading.Thread(target=self._watch, name="zwerm-alarm", daemon=True)
        self._thread.start()

    def set(self, due_s: float) -> None:
        """Ring at `due_s` of the monotonic clock. A time later than the last one wakes nobody up: it costs little."""
        with self._changed:
            self._due_s = due_s
            if due_s < self._wakes_s:
                self._changed.notify()

    def close(self) -> None:
        """End the thread; idempotent."""
        with self._changed:
            self._open = False
            self._changed.notify()
        self._thread.join()

    def _watch(self) -> None:
        with self._changed:
            while self._open:
                now_s = time.monotonic()
                if self._due_s is not None and self._due_s <= now_s:
                    self._due_s = None
                    self._ring()
                self._wakes_s = float("inf") if self._due_s is None else self._due_s
                self._changed.wait(None if self._due_s is None else self._due_s - now_s)
