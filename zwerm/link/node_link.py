"""A node's end of a Zenoh link: a client session that is connected to the world's router only.

`join` subscribes before it sends hello, so no message to a welcomed node is lost. Messages arrive in the order sent. If the
transport is lost, the link is lost for good, and the world reports the node lost.
"""

import contextlib
import os
import queue
import threading
import time
from collections.abc import Callable
from typing import Final

import zenoh
from zenoh.handlers import Callback, FifoChannel

from zwerm.errors import LinkError
from zwerm.link.admission import MEANINGS
from zwerm.link.session import (
    TERMS,
    Credential,
    Terms,
    close_without_waiting,
    is_local,
    keep_thread,
    open_session,
    transport_settings,
    trust_settings,
)
from zwerm.link.software import software
from zwerm.wire.keys import alive_key, command_key, hello_key, observation_key
from zwerm.wire.messages import REFUSABLE, Goodbye, Hello, Welcome, decode_welcome, encode, refusal

RETRY_S: Final = 0.05

# Zenoh needs a time limit for each query. A year means no limit: if the world is gone, its transport closes first.
LEAVE_TIMEOUT_S: Final = 365.0 * 86_400.0


class ZenohNodeLink:
    """The link of the node in `credential` to the run `run`, connected to `endpoint`.

    Zenoh's thread calls `on_lost` when the connection to the world is lost. Before `listen` is called, messages wait for
    `receive`.
    """

    send: Callable[[bytes], None]

    def __init__(
        self,
        run: str,
        credential: Credential,
        endpoint: str,
        *,
        terms: Terms = TERMS,
        deadline_s: float = 30.0,
        on_lost: Callable[[], object] | None = None,
    ) -> None:
        """Connect. Raises LinkError if it does not succeed within `deadline_s` seconds."""
        self._run = run
        self._software, self._process = ("", os.getpid()) if is_local(endpoint) else (software(), 0)
        self._credential = credential
        self._place = f"node {credential.node} at {endpoint}"
        self._deadline_s = time.monotonic() + deadline_s
        self._inbox: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._deliver: Callable[[bytes], object] = self._inbox.put
        self._take: Callable[[bytes], object] = self._take_while_starting
        self._delivering = threading.Lock()
        self._listening = False
        self._on_lost = on_lost
        self._session = open_session(
            {
                "mode": "client",
                "id": credential.zid,
                "connect/endpoints": [endpoint],
                "connect/timeout_ms": round(1000 * deadline_s),
                "connect/exit_on_failure": True,
                "transport/auth/usrpwd": {"user": credential.user, "password": credential.password},
                **transport_settings([endpoint], terms.lease_s),
                **trust_settings(credential, terms),
            },
            f"{self._place}: no world answers there, or it does not take these credentials",
        )
        if not is_local(endpoint):
            close_without_waiting()
        try:
            self._session.info.declare_transport_events_listener(Callback(self._on_transport, indirect=False))
            self.send = self._session.declare_publisher(
                command_key(run, credential.node),
                express=True,
                congestion_control=zenoh.CongestionControl.BLOCK,
                allowed_destination=zenoh.Locality.REMOTE,
            ).put
        except BaseException:
            self.close()
            raise

    def join(self) -> Welcome:
        """Send hello until the world answers. Raises LinkError if the world refuses or does not answer in time."""
        node = self._credential.node
        self._session.declare_subscriber(
            observation_key(self._run, node),
            Callback(self._on_sample, indirect=False),
            allowed_origin=zenoh.Locality.REMOTE,
        )
        # Kept as an attribute, because Zenoh withdraws an unreferenced token. Declared before hello, so that the world
        # knows the token when it answers.
        self._token = self._session.liveliness().declare_token(alive_key(self._run, node))
        hello = encode(Hello(node, self._credential.incarnation, self._software, self._process))
        while (left_s := self._deadline_s - time.monotonic()) > 0:
            replies = self._session.get(
                hello_key(self._run, node), FifoChannel(1), payload=hello, timeout=left_s, express=True
            )
            for reply in replies:
                if reply.ok is not None:
                    return self._opened(reply.ok.payload.to_bytes())
            time.sleep(RETRY_S)  # the world listens already, but does not answer yet
        raise LinkError(f"{self._place}: the world did not answer hello in time")

    def listen(self, deliver: Callable[[bytes], object]) -> None:
        """Call `deliver` with each message from now on, waiting messages first. It runs in Zenoh's thread."""
        with self._delivering:
            while (payload := self.receive(0)) is not None:
                deliver(payload)
            self._deliver = deliver
            self._listening = True

    def receive(self, timeout_s: float) -> bytes | None:
        """Return the next message from the world, or None after `timeout_s` seconds without one."""
        with contextlib.suppress(queue.Empty):
            return self._inbox.get(timeout=max(timeout_s, 0.0))
        return None

    def send_goodbye(self, reason: str, confirmed: Callable[[], object]) -> None:
        """Send goodbye and return at once. Zenoh's thread calls `confirmed` when the world has confirmed the goodbye.

        Then all earlier messages have arrived, and the link may be closed; closing it earlier could lose messages. There is
        no time limit: a slow world still gets all messages. `confirmed` is also called when the link is closed.
        """
        try:
            self._session.get(
                hello_key(self._run, self._credential.node),
                Callback(_ignore, confirmed, indirect=False),
                payload=encode(Goodbye(reason)),
                timeout=LEAVE_TIMEOUT_S,
                express=True,
            )
        except zenoh.ZError:  # closed already
            confirmed()

    def close(self) -> None:
        """Release all that the link holds; idempotent."""
        self._on_lost = None
        self._session.close()  # type: ignore[no-untyped-call]

    def _opened(self, payload: bytes) -> Welcome:
        try:
            welcome: Welcome = decode_welcome(payload)
        except REFUSABLE as error:
            raise LinkError(f"{self._place}: the world's welcome is {refusal(error)}") from None
        if welcome.refused:
            meaning = MEANINGS.get(welcome.refused)
            reason = ": ".join(filter(None, (welcome.refused, meaning, welcome.detail)))
            raise LinkError(f"{self._place}: the world refuses it: {reason}")
        return welcome

    def _on_sample(self, sample: zenoh.Sample) -> None:
        take = self._take  # a call as an attribute would look for a method first, each time
        take(sample.payload.to_bytes())

    def _take_while_starting(self, payload: bytes) -> None:
        """Deliver a message while `listen` may run in another thread; later messages skip the lock."""
        keep_thread()
        with self._delivering:
            self._deliver(payload)
            if self._listening:
                self._take = self._deliver

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        if event.kind == zenoh.SampleKind.DELETE and self._on_lost is not None:
            self._on_lost()


def _ignore(reply: zenoh.Reply) -> None:
    """Ignore the content of a reply."""
