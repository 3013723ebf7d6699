"""The memory link: nodes live in the world's own process and answer as soon as they are sent something."""

from collections import deque
from collections.abc import Callable, Sequence

from zwerm.errors import LinkError
from zwerm.link import Answer, Arrival, arrival


class MemoryLink:
    """The world's end of nodes that run inline. A node is the function that answers one message with one message.

    `make`, of a node's id and incarnation, returns the node that is started when a fault demands it; those in `unborn` do
    not run before that.
    """

    def __init__(
        self, nodes: dict[int, Answer], make: Callable[[int, int], Answer] | None = None, unborn: Sequence[int] = ()
    ) -> None:
        self._nodes = {node: answer for node, answer in nodes.items() if node not in unborn}
        self._make = make
        self._incarnation = dict.fromkeys(self._nodes, 1)
        self._arrivals: deque[Arrival] = deque()

    def send(self, node: int, payload: bytes) -> None:
        """Hand the message to the node, and queue its answer."""
        self._arrivals.append(arrival((node, self._nodes[node](payload))))

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next answer, or None at once: nothing can come later than it was asked for."""
        return self._arrivals.popleft() if self._arrivals else None

    def receive_many(self, count: int, timeout_s: float) -> list[Arrival]:
        """Return all answers, at once: nothing can come later than it was asked for."""
        arrivals = list(self._arrivals)
        self._arrivals.clear()
        return arrivals

    def close(self) -> None:
        """Forget what has not been received."""
        self._arrivals.clear()

    def kill(self, node: int) -> None:
        """Forget a node and all that it knew."""
        del self._nodes[node]
        self._arrivals.append(Arrival(node, None))

    def start(self, node: int) -> None:
        """Make a node, its next incarnation if there was one before."""
        if self._make is None:
            raise LinkError(f"node {node} cannot be started: nobody has said how")
        self._incarnation[node] = self._incarnation.get(node, 0) + 1
        self._nodes[node] = self._make(node, self._incarnation[node])

    def pause(self, node: int) -> None:
        """Do nothing: a node that is sent nothing stands still."""

    def resume(self, node: int) -> None:
        """Do nothing."""
