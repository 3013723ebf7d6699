"""The coordinator of landmark-based exploration by itself: it acknowledges uploads, and ignores what it cannot decode."""

from zwerm.agents.landmark_exploration.sharing import landmark_messages as messages
from zwerm.agents.landmark_exploration.sharing.landmark_messages import Entries, Vector
from zwerm.agents.runtime.contract import Setup
from zwerm.coordinator.landmark_exploration import LandmarkCoordinator
from zwerm.wire.messages import Observation, Packet

ROBOTS = 3


def coordinator(incarnation: int = 1) -> LandmarkCoordinator:
    return LandmarkCoordinator(
        Setup(ROBOTS, "coordinator", 0.1, (), bytes(16), channels=("uplink",), incarnation=incarnation)
    )


def answers(node: LandmarkCoordinator, tick: int, *payloads: bytes) -> list[tuple[int | None, Vector]]:
    """Return the acknowledgements of a tick in which robot 1 has sent these payloads."""
    inbox = tuple(Packet("uplink", payload, 1) for payload in payloads)
    outbox = node.step(Observation(tick, 0.1 * tick, inbox)).outbox
    read = [(each.to, messages.read(each.payload)) for each in outbox]
    return [(to, message) for to, message in read if isinstance(message, Vector)]


def test_the_coordinator_acknowledges_the_number_of_entries_that_it_has() -> None:
    node = coordinator()
    upload = messages.write(Entries(7, 0, (b"a", b"b")))
    assert answers(node, 0, upload) == [(1, Vector(7, 8, (7, 2), ask=False))]
    assert answers(node, 1, upload) == [(1, Vector(7, 8, (7, 2), ask=False))], "a repeated upload"
    assert answers(node, 2) == []


def test_a_part_with_a_gap_before_it_is_not_acknowledged() -> None:
    node = coordinator()
    assert answers(node, 0, messages.write(Entries(7, 1, (b"b",)))) == [(1, Vector(7, 8, (7, 0), ask=False))]


def test_a_coordinator_without_memory_acknowledges_nothing_of_what_it_had() -> None:
    first, again = (messages.write(Entries(7, number, (b"a",))) for number in (0, 1))
    node = coordinator()
    answers(node, 0, first)
    assert answers(node, 1, again) == [(1, Vector(7, 8, (7, 2), ask=False))]
    assert answers(coordinator(incarnation=2), 2, again) == [(1, Vector(7, 8, (7, 0), ask=False))]


def test_bytes_of_any_kind_are_ignored() -> None:
    assert answers(coordinator(), 0, b"", b"\xff" * 40, messages.write(Entries(7, 0, (b"a",)))[:-1]) == []
