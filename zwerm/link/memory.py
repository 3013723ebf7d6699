"""The memory link: nodes live in the world's own process and answer as soon as they are sent something."""

from collections import deque

from zwerm.link import Answer, Arrival


class MemoryLink:
    """The world's end of nodes that run inline. A node is the function that answers one message with one message."""

    def __init__(self, nodes: dict[int, Answer]) -> None:
        self._nodes = nodes
        self._arrivals: deque[Arrival] = deque()

    def send(self, node: int, payload: bytes) -> None:
        """Hand the message to the node, and queue its answer."""
        self._arrivals.append(Arrival(node, self._nodes[node](payload)))

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next answer, or None at once: nothing can come later than it was asked for."""
        return self._arrivals.popleft() if self._arrivals else None

    def close(self) -> None:
        """Forget what has not been received."""
        self._arrivals.clear()
