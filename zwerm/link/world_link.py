"""The world's end of a Zenoh link: a session that is also the router, so each message takes one hop.

Only expected and welcomed nodes are received, one incarnation of each at a time. Messages of a node arrive in the order sent,
and the end of its process after its last message. `refusals` counts the refused messages. The access control in the
router's settings decides which node may connect and use which key.

Zenoh's thread receives messages, and wakes the world only when as many have arrived as the world waits for. A thread switch
for each message would cost more than the work on the message.
"""

import contextlib
import threading
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, Final

import msgspec
import zenoh
from zenoh.handlers import Callback

from zwerm.errors import LinkError
from zwerm.link import Arrival, arrival
from zwerm.link.admission import CUT_OFF, EVICTED, IDENTITY, NOT_JOINED, SOFTWARE, Admission, ExpectedNode
from zwerm.link.arrival_signal import ArrivalSignal
from zwerm.link.connections import Connections, connected_processes
from zwerm.link.session import TWO_THREADS, keep_thread, open_session, set_threads
from zwerm.link.software import software
from zwerm.wire.keys import EVERY, alive_key, command_key, hello_key, node_of, observation_key
from zwerm.wire.messages import REFUSABLE, Goodbye, Welcome, decode_hello, encode, refusal
from zwerm.wire.refusals import Refusals

# Largest number of waiting arrivals. Lock-step needs fewer: one for each node. At this number Zenoh's thread blocks, and then
# the senders do.
CAPACITY: Final = 16_384


class ZenohWorldLink:
    """The world's end of the link to the nodes `members` of the run `run`; `settings` are the router's.

    `processes` returns the ids of the nodes' processes, if all nodes are on this machine.
    """

    def __init__(
        self,
        run: str,
        members: Mapping[int, ExpectedNode],
        settings: Mapping[str, Any],
        processes: Callable[[], Collection[int]] | None = None,
    ) -> None:
        """Open the router's session, without waiting for nodes. Raises LinkError if it cannot listen."""
        self.refusals = Refusals()
        self._evicted: set[int] = set()
        self._run = run
        self._members = Admission(members, software())
        self._source_of: dict[str, int] = {}
        self._processes = processes
        self._process_of: dict[int, int] = {}  # as nodes named them
        self._knows_processes = False
        self._signal = ArrivalSignal()
        self._lock = self._signal.lock
        self._room = threading.Condition(self._lock)  # only Zenoh's threads wait for it
        self._dismissed = False
        self._arrivals: deque[Arrival] = deque()
        self._wanted = CAPACITY  # number of arrivals at which Zenoh's thread wakes the receiver
        self._losses = 0  # lost nodes among the arrivals
        self._closed = False
        set_threads(TWO_THREADS)
        self._session = open_session({"mode": "router", **settings}, "the world cannot listen")
        try:
            self._put = {node: self._publisher(observation_key(run, node)).put for node in members}
            self._session.declare_subscriber(command_key(run, EVERY), Callback(self._on_command, indirect=False))
            self._session.liveliness().declare_subscriber(alive_key(run, EVERY), self._on_liveliness)
            self._connections = Connections(self._session, self._may_stay, self._on_cut, self._may_connect)
            self._session.declare_queryable(hello_key(run, EVERY), self._on_hello)
        except BaseException:
            self._session.close()  # type: ignore[no-untyped-call]
            raise

    @property
    def joined(self) -> frozenset[int]:
        """Nodes that have been welcomed and are not lost."""
        return frozenset(self._members.joined)

    def wait_joined(self, enough: Callable[[Collection[int]], bool], timeout_s: float) -> bool:
        """Wait until `enough(joined nodes)` is true; return whether it is within `timeout_s` seconds."""
        return self._signal.wait_for(lambda: enough(self._members.joined.keys()), timeout_s)

    def expect(self, node: int, member: ExpectedNode) -> None:
        """Allow a lost or new node to join as `member`. Raises LinkError if it is still joined."""
        with self._lock:
            try:
                self._members.expect(node, member)
            except ValueError as error:
                raise LinkError(str(error)) from None
            if node not in self._put:
                self._put[node] = self._publisher(observation_key(self._run, node)).put

    def send(self, node: int, payload: bytes) -> None:
        """Send one message to a node that has joined."""
        self._put[node](payload)

    def send_many(self, messages: Iterable[tuple[int, bytes]]) -> None:
        """Send messages to nodes that have joined, each as soon as `messages` yields it."""
        put = self._put
        for node, payload in messages:
            put[node](payload)

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next arrival, or None after `timeout_s` seconds without one. Raises LinkError once closed."""
        self._wait(1, timeout_s)
        if not self._arrivals:
            return None
        return self._take(1)[0]

    def receive_many(self, count: int, timeout_s: float) -> list[Arrival]:
        """Return all arrivals once there are `count`, or a node is lost, or `timeout_s` seconds have passed.

        Raises LinkError once closed.
        """
        self._wait(count, timeout_s)
        return self._take(len(self._arrivals))

    def dismiss(self, reason: str) -> None:
        """Request every joined node to exit; their end is not reported as a loss."""
        self._dismissed = True
        if self._session.is_closed():
            return
        farewell = encode(Goodbye(reason))
        for node in sorted(self._members.joined):
            self._put[node](farewell)

    def idle(self, nodes: Sequence[int], timeout_s: float) -> list[int]:
        """Dismiss `nodes`, whose answers are missing, and return those that leave within `timeout_s` without an answer."""
        farewell = encode(Goodbye("its answer did not come in time"))
        asked = [node for node in nodes if node in self._members.joined]
        for node in asked:
            self._put[node](farewell)
        self.wait_joined(lambda joined: not any(node in joined for node in asked), timeout_s)
        left = [node for node in asked if node not in self._members.joined]
        answered = {arrival.node for arrival in self.receive_many(0, 0.0) if arrival.payload is not None}
        return [node for node in left if node not in answered]

    def evict(self, node: int) -> None:
        """Drop all messages of a node that arrive from now on, and close its connection where the world can."""
        with self._lock:
            self._evicted.add(node)
            self._source_of.pop(command_key(self._run, node), None)
            session = self._members.expected(node).session
        self._connections.cut(session)

    def node_of_session(self, session: str) -> int:
        """Return the node that has joined by the session with this Zenoh id, or -1."""
        with self._lock:
            return self._members.node_of_session(session)

    def close(self) -> None:
        """Release all resources of the link; idempotent."""
        self._dismissed = True
        with self._lock:
            self._closed = True
            self._room.notify_all()
            self._signal.notify()
        self._session.close()  # type: ignore[no-untyped-call]

    def _wait(self, count: int, timeout_s: float) -> None:
        if self._closed:
            raise LinkError("the world's link is closed")
        if len(self._arrivals) >= count or timeout_s <= 0:
            return
        self._wanted = wanted = min(count, CAPACITY)
        self._signal.wait_for(lambda: len(self._arrivals) >= wanted or self._losses or self._closed, timeout_s)
        self._wanted = CAPACITY

    def _take(self, count: int) -> list[Arrival]:
        full = len(self._arrivals) >= CAPACITY
        pop = self._arrivals.popleft
        arrivals = [pop() for _ in range(count)]
        if full or self._losses:
            with self._lock:
                self._losses -= sum(arrival.payload is None for arrival in arrivals)
                self._room.notify_all()
        return arrivals

    def _publisher(self, key: str) -> zenoh.Publisher:
        return self._session.declare_publisher(
            key,
            express=True,
            congestion_control=zenoh.CongestionControl.BLOCK,
            allowed_destination=zenoh.Locality.REMOTE,
        )

    def _on_command(self, sample: zenoh.Sample) -> None:
        """Receive a message; access control limits its sender to the key's node. Runs in Zenoh's thread."""
        keep_thread()
        node = self._source_of.get(str(sample.key_expr))
        if node is None:
            self._refuse_command(node_of(str(sample.key_expr)))
            return
        self._arrivals.append(arrival((node, sample.payload.to_bytes())))
        if len(self._arrivals) >= self._wanted:
            self._signal.notify()
        if len(self._arrivals) >= CAPACITY:
            with self._room:
                self._room.wait_for(lambda: len(self._arrivals) < CAPACITY or self._closed)

    def _refuse_command(self, node: int) -> None:
        """Count a command of a node that has not joined or was evicted."""
        with self._lock:
            self.refusals.count(node, EVICTED if node in self._evicted else NOT_JOINED)

    def _may_stay(self, session: str) -> bool:
        """Return whether a session with this Zenoh id belongs to a node of the run that was not evicted."""
        with self._lock:
            node = self._members.owner_of(session)
            return node not in self._evicted and (node >= 0 or not self._members.knows_sessions)

    def _may_connect(self) -> Mapping[int, int] | None:
        """Return the processes that may connect to a Unix socket and how often each may; None where that is not known."""
        if self._processes is not None:
            return Counter(self._processes())
        with self._lock:
            if not self._knows_processes:
                return None
            stays = self._members.joined.keys() - self._evicted
            return Counter(process for node, process in self._process_of.items() if node in stays)

    def _settle_processes(self) -> None:
        """Once all nodes have joined, cut off who else has connected to a Unix socket.

        Not where a node there names no process, or none that has connected: the ids of a container differ from those here.
        """
        with self._lock:
            if self._processes is not None or self._knows_processes or not self._members.is_complete:
                return
            named = {node: self._process_of.get(node, 0) for node in self._members.joined}
            sessions = {node: self._members.expected(node).session for node in named}
        connected = connected_processes()
        known = all(
            process in connected if process else not self._connections.is_local(sessions[node])
            for node, process in named.items()
        )
        with self._lock:
            self._knows_processes = known
        if known:
            self._connections.cut_foreign()

    def _on_cut(self, session: str) -> None:
        """Count a session whose connection was closed."""
        with self._lock:
            self.refusals.count(self._members.owner_of(session), CUT_OFF)

    def _on_liveliness(self, sample: zenoh.Sample) -> None:
        """Handle a liveliness token; it vanishes after the node's last message. Runs in a thread of its own."""
        if sample.kind == zenoh.SampleKind.PUT:
            return
        node = node_of(str(sample.key_expr))
        with self._lock:
            self._source_of.pop(command_key(self._run, node), None)
            if self._members.lose(node) and not self._dismissed:
                self._arrivals.append(Arrival(node, None))
                self._losses += 1
            self._signal.notify()

    def _on_hello(self, query: zenoh.Query) -> None:
        """Answer a node's hello or goodbye. Runs in a thread of its own."""
        with query, contextlib.suppress(zenoh.ZError):  # the link was closed
            key = str(query.key_expr)
            try:
                welcome = self._welcome(node_of(key), query.payload.to_bytes() if query.payload else b"")
            except ValueError:
                welcome = Welcome(refused=IDENTITY)
            if welcome.refused:
                with self._lock:
                    self.refusals.count(_node_in(key), welcome.refused)
            query.reply(key, encode(welcome))
            self._settle_processes()

    def _welcome(self, node: int, payload: bytes) -> Welcome:
        """Admit the node and return its controller and Setup, or return the reason for refusing it."""
        try:
            hello = decode_hello(payload)
        except REFUSABLE as error:
            return Welcome(refused=refusal(error).reason)
        with self._lock:
            refused = self._members.greet(node, hello)
            if isinstance(hello, Goodbye):
                return Welcome(refused=refused)
            if refused:
                differing = f"the world has {software()}; the node has {hello.software}" if refused == SOFTWARE else ""
                return Welcome(refused=refused, detail=differing)
            member = self._members.expected(node)
            self._source_of[command_key(self._run, node)] = node
            if hello.process:
                self._process_of[node] = hello.process
            self._signal.notify()
        return Welcome(
            controller=member.controller, setup=msgspec.Raw(member.setup), paced=member.paced, code=member.code
        )


def _node_in(key: str) -> int:
    """Return the node that a key names, or -1 for none."""
    try:
        return node_of(key)
    except ValueError:
        return -1
