"""Admission: which incarnation of each node may join, has joined, or has ended. Without I/O, clock and threads.

A node joins at most once in each incarnation. An incarnation that has ended, for any reason, stays ended. Its
credential is refused from then on. So a program that was cut off and comes back acts for no robot. `expect` admits the
next incarnation.
"""

from collections.abc import Mapping
from typing import Final

from msgspec import Struct

from zwerm.wire.messages import Goodbye, Hello

# Reasons of a refusal, as they are counted, and what each means to those who started the refused program.
IDENTITY: Final = "identity"
UNKNOWN: Final = "unknown"
INCARNATION: Final = "incarnation"
JOINED: Final = "joined"
RETURNED: Final = "returned"
NOT_JOINED: Final = "not-joined"
SOFTWARE: Final = "software"
EVICTED: Final = "evicted"
CUT_OFF: Final = "cut-off"
MEANINGS: Final[Mapping[str, str]] = {
    IDENTITY: "it says that it is another node",
    UNKNOWN: "the run has no such node",
    INCARNATION: "the run expects another incarnation of it",
    JOINED: "it has joined already, and that connection is not given up as lost yet",
    RETURNED: "the run has given it up as lost, and takes no lost node back; it stays where it was",
    SOFTWARE: "its releases differ from the world's",
    NOT_JOINED: "it has not joined",
}


class ExpectedNode(Struct, frozen=True):
    """A node that may join: its incarnation, its controller's name, its encoded Setup, and whether time is real.

    `code` is the digest of its controller's file, and `session` the Zenoh id of its session.
    """

    incarnation: int
    controller: str
    setup: bytes
    paced: bool = False
    code: str = ""
    session: str = ""


class Admission:
    """The admission to a run that expects `members`. `joined` holds the incarnation of each node that has joined.

    A node that names its releases must have those of `software`.
    """

    def __init__(self, members: Mapping[int, ExpectedNode], software: str = "") -> None:
        self._software = software
        self.joined: dict[int, int] = {}
        self._expected = dict(members)
        self._ended: dict[int, int] = {}

    def greet(self, node: int, message: Hello | Goodbye) -> str:
        """Admit a node that sends hello, or record its goodbye. Return the reason of a refusal, or ""."""
        if isinstance(message, Goodbye):
            return "" if node in self.joined else NOT_JOINED
        expected = self._expected.get(node)
        if message.node != node:
            return IDENTITY
        if expected is None:
            return UNKNOWN
        if message.incarnation != expected.incarnation:
            return INCARNATION
        if message.software and self._software and message.software != self._software:
            return SOFTWARE
        if node in self.joined:
            return JOINED
        if self._ended.get(node, 0) >= message.incarnation:
            return RETURNED
        self.joined[node] = expected.incarnation
        return ""

    def node_of_session(self, session: str) -> int:
        """Return the node that has joined by this session, or -1. The router admits no second session with its id."""
        return next((node for node in self.joined if self._expected[node].session == session), -1)

    def owner_of(self, session: str) -> int:
        """Return the node whose session has this Zenoh id, whether it has joined or not, or -1."""
        return next((node for node, expected in self._expected.items() if expected.session == session), -1)

    @property
    def knows_sessions(self) -> bool:
        """Whether the Zenoh id of every node's session is known."""
        return all(expected.session for expected in self._expected.values())

    @property
    def is_complete(self) -> bool:
        """Whether every node that is expected has joined, now or before: no other session may join."""
        return all(
            node in self.joined or self._ended.get(node, 0) >= member.incarnation
            for node, member in self._expected.items()
        )

    def expected(self, node: int) -> ExpectedNode:
        """Return what is expected of a node that has been admitted."""
        return self._expected[node]

    def lose(self, node: int) -> bool:
        """Record that a node's connection has ended; return whether the node had joined."""
        incarnation = self.joined.pop(node, None)
        if incarnation is None:
            return False
        self._ended[node] = incarnation
        return True

    def expect(self, node: int, member: ExpectedNode) -> None:
        """Admit `node` from now on as `member`. Raises ValueError while it is joined."""
        if node in self.joined:
            raise ValueError(f"node {node} is still joined as incarnation {self.joined[node]}")
        self._expected[node] = member
