"""A coordinator of many robots divides its messages into commands that the world accepts."""

import pytest

from zwerm.agents.sensor_coverage.messages.commands import ScanRequest, read_request
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox
from zwerm.wire.messages import MESSAGE_BYTES_MAX, Command, encode_command, open_answer


@pytest.mark.parametrize("snapshot_bytes", [0, 40_000])
def test_requests_to_two_thousand_robots_fit_into_commands_and_lose_nothing(snapshot_bytes: int) -> None:
    mailbox = CommandMailbox(0.1)
    moved = tuple(range(5_000, 5_040))
    mailbox.receive(0.0, ())
    for robot in range(2_000):
        mailbox.send(robot, ScanRequest(2, moved))
    sent: list[int] = []
    ticks = 0
    while True:
        outbox = mailbox.outgoing(snapshot_bytes)
        if not outbox:
            break
        payload = encode_command(Command(tick=2**40, outbox=outbox, snapshot=bytes(snapshot_bytes)))
        assert len(payload) <= MESSAGE_BYTES_MAX
        open_answer(payload)
        for packet in outbox:
            request = read_request(packet.payload)
            assert request is not None
            assert request.command == ScanRequest(2, moved)
            assert packet.to is not None
            sent.append(packet.to)
        ticks += 1
        assert mailbox.next_wake_s() == pytest.approx(0.1 * ticks if len(sent) < 2_000 else 0.1 * (80 // 4))
        mailbox.receive(0.1 * ticks, ())
    assert sent == list(range(2_000))
    assert 1 < ticks < 30


def test_requests_to_few_robots_leave_in_one_command() -> None:
    mailbox = CommandMailbox(0.1)
    for robot in range(100):
        mailbox.send(robot, ScanRequest(2, (1, 2, 3)))
    assert len(mailbox.outgoing(3_000)) == 100
    assert mailbox.outgoing() == ()
