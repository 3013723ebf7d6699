"""The memory link: nodes run in the world's process and answer each message at once."""

from collections import deque
from collections.abc import Callable, Sequence

from zwerm.errors import LinkError
from zwerm.link import Answer, Arrival, arrival


class MemoryLink:
    """The world's end of the link to inline nodes. A node is a function from one message to its answer.

    `make` returns a node from its id and incarnation, when a fault starts it. The nodes `late_joiners` do not run before.
    """

    def __init__(
        self,
        nodes: dict[int, Answer],
        make: Callable[[int, int], Answer] | None = None,
        late_joiners: Sequence[int] = (),
    ) -> None:
        self._nodes = {node: answer for node, answer in nodes.items() if node not in late_joiners}
        self._make = make
        self._incarnation = dict.fromkeys(self._nodes, 1)
        self._arrivals: deque[Arrival] = deque()

    def send(self, node: int, payload: bytes) -> None:
        """Hand the message to the node, and queue its answer."""
        self._arrivals.append(arrival((node, self._nodes[node](payload))))

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next answer, or None at once: answers never come later."""
        return self._arrivals.popleft() if self._arrivals else None

    def receive_many(self, count: int, timeout_s: float) -> list[Arrival]:
        """Return all answers at once: answers never come later."""
        arrivals = list(self._arrivals)
        self._arrivals.clear()
        return arrivals

    def close(self) -> None:
        """Discard the answers not yet received."""
        self._arrivals.clear()

    def kill(self, node: int) -> None:
        """Discard a node and its state, and report it lost."""
        del self._nodes[node]
        self._arrivals.append(Arrival(node, None))

    def start(self, node: int) -> None:
        """Make a node, as its next incarnation if it ran before."""
        if self._make is None:
            raise LinkError(f"node {node} cannot be started: the link has no function that makes nodes")
        self._incarnation[node] = self._incarnation.get(node, 0) + 1
        self._nodes[node] = self._make(node, self._incarnation[node])

    def pause(self, node: int) -> None:
        """Do nothing: an inline node computes only when it gets a message."""

    def resume(self, node: int) -> None:
        """Do nothing."""
