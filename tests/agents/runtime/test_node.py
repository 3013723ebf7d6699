"""A node without its transport: its answers as bytes, and the failures of its controller."""

import msgspec
import pytest

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.agents.runtime.node import ERROR_CHARS_MAX, Node
from zwerm.wire.messages import (
    MESSAGE_BYTES_MAX,
    Command,
    Failure,
    Observation,
    Packet,
    Transmission,
    decode_observation,
    encode,
    open_answer,
)


class Echo(Controller):
    """Sends each received payload back; a payload that names a defect causes it."""

    def step(self, observation: Observation) -> Command:
        payloads = [packet.payload for packet in observation.inbox]
        if b"raise" in payloads:
            raise ValueError("broken \x1b[2J" + "x" * 2 * ERROR_CHARS_MAX)
        if b"exit" in payloads:
            raise SystemExit(3)
        if b"nothing" in payloads:
            return None  # type: ignore[return-value]
        if b"large" in payloads:
            payloads = [bytes(MESSAGE_BYTES_MAX)]
        return Command(outbox=tuple(Transmission("robots", payload) for payload in payloads))


def node(failures: list[str]) -> Node:
    setup = Setup(3, "robot", 0.1, (), bytes(16), channels=("robots",))
    return Node(f"{__name__}:Echo", setup, lambda: failures.append("failed"))


def observed(*payloads: bytes) -> bytes:
    return encode(Observation(7, 0.7, tuple(Packet("robots", payload, 1) for payload in payloads)))


def test_the_answer_has_the_tick_of_the_observation_and_equal_observations_give_equal_bytes() -> None:
    failures: list[str] = []
    answer = node(failures).answer(observed(b"a", b"b"))
    command = open_answer(answer)
    assert command == Command(7, outbox=(Transmission("robots", b"a"), Transmission("robots", b"b")))
    assert node(failures).answer(observed(b"a", b"b")) == answer != node(failures).answer(observed(b"b", b"a"))
    assert failures == []


@pytest.mark.parametrize(
    ("payload", "error"),
    [
        (b"raise", r"ValueError: broken \x1b[2Jxxx"),
        (b"exit", "SystemExit: 3"),
        (b"nothing", "TypeError: step() returned None, expected a Command"),
        (b"large", "ValueError: the command takes 65"),
    ],
)
def test_a_defect_of_a_controller_is_a_failure_with_its_tick_and_place(payload: bytes, error: str) -> None:
    failures: list[str] = []
    failure = open_answer(node(failures).answer(observed(payload)))
    assert isinstance(failure, Failure)
    assert failure.tick == 7
    assert failure.error.startswith(error)
    assert failure.error.endswith((", in Echo.step)", ", in step)"))
    assert "test_node.py:" in failure.error
    assert len(failure.error) < ERROR_CHARS_MAX + 100
    assert failures == ["failed"]


def test_a_node_goes_on_after_a_failure_and_an_interrupt_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    failures: list[str] = []
    robot = node(failures)
    robot.answer(observed(b"raise"))
    assert open_answer(robot.answer(observed(b"a"))).tick == 7

    def interrupt(self: Echo, observation: Observation) -> Command:
        raise KeyboardInterrupt

    monkeypatch.setattr(f"{__name__}.Echo.step", interrupt)
    with pytest.raises(KeyboardInterrupt):
        node(failures).answer(observed())
    assert failures == ["failed"]


def test_a_radio_replaces_the_inbox_and_carries_the_packets() -> None:
    class Radio:
        """A radio that has received one packet."""

        sent: list[tuple[int, bytes]] = []  # noqa: RUF012

        def begin(self) -> None:
            """Do nothing: this radio is ready."""

        def take(self, tick: int) -> tuple[Packet, ...]:
            """Return the packet."""
            return (Packet("robots", b"by radio", 2),)

        def send(self, tick: int, message: Transmission) -> None:
            """Keep a packet."""
            self.sent.append((tick, message.payload))

    robot, radio = node([]), Radio()
    robot.use_radio(radio)  # type: ignore[arg-type]
    answer = open_answer(robot.answer(observed(b"by the world")))
    assert answer == Command(7, outbox=(Transmission("robots", b"by radio"),))
    assert radio.sent == [(7, b"by radio")]
    assert decode_observation(observed(b"by the world")).inbox[0].payload == b"by the world"


def test_the_setup_survives_the_wire() -> None:
    setup = Setup(3, "robot", 0.1, ("touch",), bytes(16), channels=("robots",), incarnation=2)
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(setup), type=Setup) == setup
