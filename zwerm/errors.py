"""The errors a user of Zwerm can meet; each prints as one line and never as a traceback."""


class ZwermError(Exception):
    """Base of every error that the user can correct."""


class ScenarioError(ZwermError):
    """One or more mistakes in a scenario, each a line `place: rule, got value`."""

    def __init__(self, mistakes: list[str]) -> None:
        super().__init__("\n".join(mistakes))
        self.mistakes = mistakes


class ControllerError(ZwermError):
    """A controller cannot be found, or does not fulfil the contract."""


class ProtocolError(ZwermError):
    """A message was refused; `reason` is a stable name to count it by.

    A `stray` message is no answer to the newest observation: the node may still give one.
    """

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason
        self.stray = reason in ("out-of-order", "unasked", "duplicate", "crashed")


class StragglerError(ZwermError):
    """Nodes missed the wall-clock deadline of the barrier."""

    def __init__(self, nodes: list[int], tick: int, deadline_s: float) -> None:
        names = ", ".join(str(node) for node in nodes[:10]) + (" ..." if len(nodes) > 10 else "")
        super().__init__(f"tick {tick}: no command from node {names} within {deadline_s:g} s")
        self.nodes = nodes


class LinkError(ZwermError):
    """The connection between the world and its nodes could not be made, or was lost."""


class MissingExtraError(ZwermError):
    """A library of an optional extra is not installed."""


class PictureError(ZwermError):
    """A picture or an animation cannot be drawn or written."""
