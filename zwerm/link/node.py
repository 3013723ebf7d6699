"""A node's end of a Zenoh link: a client session that can reach the world's router and nothing else.

Promises: `join` subscribes before it says hello, so nothing that is sent to a welcomed node is lost; messages arrive
in the order sent. The link is lost when its transport is, and does not come back: to the world the node is lost as
well.
"""

import contextlib
import queue
import threading
import time
from collections.abc import Callable
from typing import Final

import zenoh
from zenoh.handlers import Callback, FifoChannel

from zwerm.errors import LinkError
from zwerm.link.session import Credential, keep_thread, open_session, transport_settings, trust_settings
from zwerm.wire.keys import alive_key, command_key, hello_key, observation_key
from zwerm.wire.messages import REFUSABLE, Goodbye, Hello, Welcome, decode_welcome, encode, refusal

RETRY_S: Final = 0.05

# Zenoh wants a limit for every query. A year stands for none: a world that is gone ends the wait by closing the transport.
LEAVE_TIMEOUT_S: Final = 365.0 * 86_400.0


class ZenohNodeLink:
    """The end of the node that `credential` names, of the run `run`, connected to `endpoint`.

    `on_lost` is called, in Zenoh's thread, when the world is gone. Until `listen` is called messages wait for
    `receive`.
    """

    send: Callable[[bytes], None]

    def __init__(
        self,
        run: str,
        credential: Credential,
        endpoint: str,
        *,
        authority_pem: str = "",
        deadline_s: float = 30.0,
        on_lost: Callable[[], object] | None = None,
    ) -> None:
        """Connect. Raises LinkError where that does not succeed within `deadline_s` seconds."""
        self._run = run
        self._credential = credential
        self._place = f"node {credential.node} at {endpoint}"
        self._deadline_s = time.monotonic() + deadline_s
        self._inbox: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._deliver: Callable[[bytes], object] = self._inbox.put
        self._take: Callable[[bytes], object] = self._take_with_care
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
                **transport_settings([endpoint]),
                **trust_settings(authority_pem),
            },
            f"{self._place}: no world answers there, or it does not take these credentials",
        )
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
        """Say hello until the world answers. Raises LinkError where it refuses, or does not answer in time."""
        node = self._credential.node
        self._session.declare_subscriber(
            observation_key(self._run, node),
            Callback(self._on_sample, indirect=False),
            allowed_origin=zenoh.Locality.REMOTE,
        )
        # Held, because Zenoh withdraws a token that nobody holds. Declared before hello, so that the world knows it by
        # then.
        self._token = self._session.liveliness().declare_token(alive_key(self._run, node))
        hello = encode(Hello(node, self._credential.incarnation))
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
        """From now on hand every message, those that wait first, to `deliver`; it runs in Zenoh's thread."""
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

    def take_leave(self, reason: str, heard: Callable[[], object]) -> None:
        """Say goodbye, and return at once; `heard` is called, in Zenoh's thread, when the world has confirmed it.

        By then all that was sent before has arrived, so the link may be closed; earlier, closing could lose what is just being
        sent. No time limit ends the wait: a world that is slow still gets everything. `heard` is also called when the link is
        closed.
        """
        try:
            self._session.get(
                hello_key(self._run, self._credential.node),
                Callback(_ignore, heard, indirect=False),
                payload=encode(Goodbye(reason)),
                timeout=LEAVE_TIMEOUT_S,
                express=True,
            )
        except zenoh.ZError:  # closed already
            heard()

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
            raise LinkError(f"{self._place}: the world refuses it: {welcome.refused}")
        return welcome

    def _on_sample(self, sample: zenoh.Sample) -> None:
        take = self._take  # called as an attribute it would be looked for as a method first, every time
        take(sample.payload.to_bytes())

    def _take_with_care(self, payload: bytes) -> None:
        """Take a message while it may not be settled who listens; after that there are no detours."""
        keep_thread()
        with self._delivering:
            self._deliver(payload)
            if self._listening:
                self._take = self._deliver

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        if event.kind == zenoh.SampleKind.DELETE and self._on_lost is not None:
            self._on_lost()


def _ignore(reply: zenoh.Reply) -> None:
    """Take an answer of which only its coming counts."""
