"""The memory link: nodes live in the world's own process and compute their answers when the world collects them."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence

from zwerm.errors import LinkError
from zwerm.link import Answer, Arrival
from zwerm.wire.refusals import Refusals


class MemoryLink:
    """The world's end of nodes that run inline. A node is a function from one message to one message.

    `send` and `send_many` only queue messages; a controller runs inside `receive` or `receive_many`. `make`, of a node's id and
    incarnation number, returns the node that a fault starts. The nodes in `late_joiners` do not run before that.
    """

    def __init__(
        self,
        nodes: dict[int, Answer],
        make: Callable[[int, int], Answer] | None = None,
        late_joiners: Sequence[int] = (),
    ) -> None:
        self.refusals = Refusals()  # none: a node in memory is never refused
        self._nodes = {node: answer for node, answer in nodes.items() if node not in late_joiners}
        self._make = make
        self._incarnation = dict.fromkeys(self._nodes, 1)
        self._unanswered: deque[tuple[int, bytes]] = deque()  # messages whose answer has not been collected
        self._losses: deque[Arrival] = deque()

    def send(self, node: int, payload: bytes) -> None:
        """Queue a message to a node."""
        self._unanswered.append((node, payload))

    def send_many(self, messages: Iterable[tuple[int, bytes]]) -> None:
        """Queue messages to nodes."""
        self._unanswered.extend(messages)

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next loss or answer, or None at once: nothing arrives later in memory."""
        if self._losses:
            return self._losses.popleft()
        if self._unanswered:
            node, payload = self._unanswered.popleft()
            return Arrival(node, self._nodes[node](payload))
        return None

    def receive_many(self, count: int, timeout_s: float) -> list[tuple[int, bytes | None]]:
        """Return all losses and answers, at once: nothing arrives later in memory."""
        losses, unanswered, nodes = self._losses, self._unanswered, self._nodes
        self._losses, self._unanswered = deque(), deque()
        answers: list[tuple[int, bytes | None]] = [(node, nodes[node](payload)) for node, payload in unanswered]
        return [*losses, *answers] if losses else answers

    def idle(self, nodes: Sequence[int], timeout_s: float) -> list[int]:
        """Return no node: in memory nothing is lost."""
        return []

    def evict(self, node: int) -> None:
        """Do nothing: a node in memory sends one answer to each message."""

    def close(self) -> None:
        """Drop everything that has not been received; idempotent."""
        self._unanswered.clear()
        self._losses.clear()

    def kill(self, node: int) -> None:
        """Drop a node, its memory and its unanswered messages."""
        del self._nodes[node]
        self._unanswered = deque(each for each in self._unanswered if each[0] != node)
        self._losses.append(Arrival(node, None))

    def start(self, node: int) -> None:
        """Make a node, as its next incarnation if it ran before. Raises LinkError without `make`."""
        if self._make is None:
            raise LinkError(f"node {node} cannot be started: the link has no function that makes nodes")
        self._incarnation[node] = self._incarnation.get(node, 0) + 1
        self._nodes[node] = self._make(node, self._incarnation[node])

    def pause(self, node: int) -> None:
        """Do nothing: the world observes no paused node, so its controller does not run."""

    def resume(self, node: int) -> None:
        """Do nothing: the world observes the node again."""

    def end_of(self, node: int, wait_s: float) -> str:
        """Return "": a node in memory has no process."""
        return ""
