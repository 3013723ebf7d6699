"""Plain answers are accepted together as they are one by one, and every other arrival is left for a closer look."""

import pytest

from zwerm.errors import ProtocolError
from zwerm.wire.messages import BodyVelocity, Command, Failure, Transmission, WheelSpeeds, encode
from zwerm.world.tick.command_intake import CommandIntake

TICK = 7
NODES = (0, 1, 2, 3)
FIXED = 3
ANSWERS = {
    0: Command(tick=TICK, drive=WheelSpeeds(0.1, 0.2)),
    1: Command(tick=TICK, telemetry={"level": 1.0}, snapshot=b"map"),
    2: Command(tick=TICK, outbox=(Transmission("robots", b"packet"),)),
    3: Command(tick=TICK),
}
GOOD = encode(ANSWERS[0])

# What is no plain answer of node 1 after the answer of node 0.
OTHERS = {
    "a loss": (1, None),
    "a failure": (1, encode(Failure(TICK, "ValueError", ""))),
    "an answer to another tick": (1, encode(Command(tick=TICK - 1))),
    "a second answer": (0, GOOD),
    "an answer of a node that was not observed": (9, GOOD),
    "an answer of a node that crashed": (2, GOOD),
    "no message": (1, GOOD[:-1]),
    "a number that is not finite": (1, encode(Command(tick=TICK, drive=WheelSpeeds(float("inf"), 0.0)))),
    "another type of drive": (1, encode(Command(tick=TICK, drive=BodyVelocity(0.1)))),
    "a drive of a node without one": (FIXED, GOOD),
    "a packet that cannot be sent": (1, encode(Command(tick=TICK, outbox=(Transmission("moon", b""),)))),
    "telemetry that breaks a rule": (1, encode(Command(tick=TICK, telemetry={"": 1.0}))),
}


class OneChannel:
    """A radio with the channel `robots`."""

    def refuses(self, sender: int, message: Transmission) -> str:
        return "" if message.channel == "robots" else f"no channel {message.channel}"


def intake() -> CommandIntake:
    found = CommandIntake(WheelSpeeds, "differential", [FIXED], OneChannel())
    found.begin_tick(TICK, NODES, [b"observation"] * len(NODES))
    return found


def test_plain_answers_are_accepted_together_as_one_by_one() -> None:
    arrivals = [(node, encode(answer)) for node, answer in ANSWERS.items()]
    together, single = intake(), intake()
    assert together.accept_plain(iter(arrivals), {}) == (len(NODES), None)
    for node, payload in arrivals:
        single.accept(node, payload)
    assert together.pending() == single.pending() == []
    assert together.end_tick() == single.end_tick() == list(ANSWERS.items())
    assert together.exchange == single.exchange
    assert together.exchange.traced[1] == encode(Command(tick=TICK))


@pytest.mark.parametrize("other", OTHERS.values(), ids=list(OTHERS))
def test_an_arrival_that_is_not_plain_is_left_with_all_after_it(other: tuple[int, bytes | None]) -> None:
    here = intake()
    arrivals = iter([(0, GOOD), other, (1, encode(Command(tick=TICK)))])
    assert here.accept_plain(arrivals, {2: "crashed"}) == (1, other)
    assert list(arrivals) == [(1, encode(Command(tick=TICK)))]
    assert here.pending() == [1, 2, 3]
    assert here.refusals.by_reason.total() == 0, "`accept` counts it"


@pytest.mark.parametrize(
    "name", [name for name in OTHERS if name not in ("a loss", "a failure", "an answer of a node that crashed")]
)
def test_accept_refuses_what_is_not_plain_for_another_reason_than_a_loss_or_a_failure(name: str) -> None:
    here = intake()
    here.accept(0, GOOD)
    node, payload = OTHERS[name]
    assert payload is not None
    with pytest.raises(ProtocolError):
        here.accept(node, payload)
