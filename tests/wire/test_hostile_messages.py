"""Malformed, forged and out-of-order messages are refused, counted by reason, and change nothing."""

import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from support import scenario
from waiting import until

from zwerm.agents.runtime.node import Node
from zwerm.deploy.identity import load
from zwerm.deploy.node_specs import node_specs
from zwerm.deploy.swarm import RemoteSwarm
from zwerm.errors import ProtocolError
from zwerm.link.node_link import ZenohNodeLink
from zwerm.run.assembly import assemble
from zwerm.run.runner import drive, new_run_id, run
from zwerm.wire.messages import (
    MESSAGE_BYTES_MAX,
    BodyVelocity,
    Command,
    Observation,
    Transmission,
    WheelSpeeds,
    decode_to_node,
    encode,
)
from zwerm.world.world import World

GOOD = Command(tick=0, drive=WheelSpeeds(0.1, 0.1))
NAN = float("nan")

# A message that a robot might send in place of its first command, and the reason of the refusal.
HOSTILE = {
    b"": "malformed",
    b"\xc1": "malformed",
    encode(GOOD)[:-3]: "malformed",
    encode(GOOD) + b"\x00": "malformed",
    b"\x91" * 30_000: "schema",
    bytes(MESSAGE_BYTES_MAX + 1): "oversized",
    encode(GOOD).replace(b"command/1", b"command/2"): "version",
    b"\x80": "schema",
    encode(GOOD).replace(b"drive", b"drove"): "schema",
    encode(Observation(0, 0.0)): "schema",
    encode(Command(tick=0, drive=WheelSpeeds(NAN, 0.0))): "not-finite",
    encode(Command(tick=0, drive=BodyVelocity(float("inf")))): "not-finite",
    encode(Command(tick=0, drive=BodyVelocity(0.1))): "wrong-drive",
    encode(Command(tick=0, outbox=(Transmission("robots", b"x"),))): "wrong-packet",
    encode(Command(tick=1)): "out-of-order",
    encode(Command(tick=-1)): "out-of-order",
    encode(Command(tick=2**62)): "out-of-order",
}


@pytest.mark.parametrize(
    ("payload", "reason"), HOSTILE.items(), ids=lambda value: value if isinstance(value, str) else ""
)
def test_a_hostile_message_is_refused_for_its_reason(payload: bytes, reason: str) -> None:
    world = assemble(scenario(robots={"on_crash": "continue"}), 1)
    world.observe()
    if reason == "out-of-order":  # a stray message: the answer may still come
        with pytest.raises(ProtocolError) as refused:
            world.accept(0, payload)
        assert (refused.value.reason, refused.value.stray) == (reason, True)
        assert world.awaited() == [0, 1, 2, 3], "the node is still awaited"
        world.accept(0, encode(GOOD))
        assert world.status.crashed == {}
    else:
        world.accept(0, payload)
        assert world.status.crashed[0].startswith(f"its command was refused: {reason}: ")
    assert world.intake.refusals.by_reason == {reason: 1}
    assert world.awaited() == [1, 2, 3]


def test_a_second_answer_and_one_from_a_node_that_does_not_exist_are_refused() -> None:
    world = assemble(scenario(), 1)
    world.observe()
    world.accept(0, encode(GOOD))
    for node, reason in ((0, "duplicate"), (4, "unasked"), (-1, "unasked")):
        with pytest.raises(ProtocolError, match=f"^{reason}:"):
            world.accept(node, encode(GOOD))
    assert world.intake.refusals.by_reason == {"duplicate": 1, "unasked": 2}


@pytest.fixture(scope="module")
def waiting_world() -> World:
    world = assemble(scenario(), 1)
    world.observe()
    return world


mutations = st.one_of(
    st.binary(max_size=200),
    st.tuples(st.integers(0, 60), st.binary(min_size=1, max_size=4)).map(
        lambda edit: encode(GOOD)[: edit[0]] + edit[1] + encode(GOOD)[edit[0] + len(edit[1]) :]
    ),
    st.integers(0, 60).map(lambda end: encode(GOOD)[:end]),
)


@settings(max_examples=5_000, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutations)
@example(encode(GOOD))
def test_any_bytes_are_refused_or_a_valid_command(waiting_world: World, payload: bytes) -> None:
    world = waiting_world
    before = world.intake.refusals.by_reason.total()
    try:
        world.intake.accept(1, payload)
    except ProtocolError:
        refused = 1
    else:
        refused = 0
        world.intake.begin_tick(0, range(4), [b""] * 4)  # so that the next example is not refused as a duplicate
    assert world.intake.refusals.by_reason.total() == before + refused
    assert 1 in world.awaited()


class Stranger(threading.Thread):
    """A robot with valid credentials that is driven by the test, over real Zenoh."""

    def __init__(self, keys: Path, endpoint: str, node: int, say: Callable[[Node, bytes], list[bytes]]) -> None:
        super().__init__(daemon=True)
        self._keys, self._endpoint, self._node, self._say = keys, endpoint, node, say

    def run(self) -> None:
        credentials = load(self._keys)
        own = next(each for each in credentials.nodes if each.node == self._node)
        link = ZenohNodeLink(credentials.run, own, self._endpoint)
        link.join()
        node = Node(*node_specs(scenario(), 1)[self._node])
        while (payload := link.receive(20.0)) is not None:
            if not isinstance(decode_to_node(payload), Observation):
                break
            for answer in self._say(node, payload):
                link.send(answer)
        link.close()


def run_with_a_stranger(tmp_path: Path, say: Callable[[Node, bytes], list[bytes]], **tables: object):
    """Run the small scenario over Zenoh; node 0 answers each observation with `say` of it, the others correctly."""
    keys, endpoint = tmp_path / "keys", f"unixsock-stream/{tmp_path}/router"
    strangers = [
        Stranger(keys, endpoint, number, say if number == 0 else lambda node, seen: [node.answer(seen)])
        for number in range(4)
    ]
    chosen = scenario(**tables)
    swarm = RemoteSwarm(new_run_id(), node_specs(chosen, 1), listen=[endpoint], credentials_file=keys, deadline_s=20.0)
    starter = threading.Thread(target=_start_when_there, args=(keys, strangers), daemon=True)
    starter.start()
    with swarm:
        return drive(assemble(chosen, 1), swarm.link, 1, "remote")


def _start_when_there(keys: Path, strangers: list[Stranger]) -> None:
    until(lambda: keys.exists() and keys.stat().st_size, "credentials written")
    for stranger in strangers:
        stranger.start()


def test_random_messages_of_a_robot_over_zenoh_are_counted_and_change_nothing(tmp_path: Path) -> None:
    stray = [payload for payload, reason in HOSTILE.items() if reason == "out-of-order"]

    def babble(node: Node, seen: bytes) -> list[bytes]:
        answer = node.answer(seen)
        return [*stray, answer, answer] if decode_to_node(seen).tick == 0 else [answer]

    result = run_with_a_stranger(tmp_path, babble)
    assert result.outcome == "time-limit"
    assert result.trace == run(scenario(), 1, "inline").trace
    refused = Counter(result.refused)
    # The second, valid, answer comes twice: which of tick 0 or 1 the copy meets is the network's choice.
    assert set(refused) <= {"duplicate", "out-of-order"}
    assert refused.total() == 4
    assert result.middleware_lost == 0


def test_a_robot_that_floods_the_world_crashes_and_its_messages_are_counted(tmp_path: Path) -> None:
    stray = encode(Command(tick=2**62))

    def flood(node: Node, seen: bytes) -> list[bytes]:
        return [stray] * 1_500 + [node.answer(seen)]

    result = run_with_a_stranger(tmp_path, flood, robots={"on_crash": "continue"})
    assert (result.outcome, result.crashed) == ("time-limit", [0])
    assert result.crash_reasons[0].startswith(
        "tick 0: flood: 1000 of its messages were refused, the last one as out-of-order: "
    )
    assert result.as_json()["refused"]["nodes"]["0"]["out-of-order"] == 1_000
    assert result.refused["out-of-order"] == 1_000


def test_a_robot_whose_answer_is_no_command_crashes_at_once(tmp_path: Path) -> None:
    result = run_with_a_stranger(tmp_path, lambda node, seen: [b"\xc1"], time={"straggler_s": 60.0})
    assert result.outcome == "failed"
    assert result.reason.startswith("node 0 crashed at tick 0: its command was refused: malformed: ")
    assert result.refused == {"malformed": 1}


def test_a_missing_answer_of_an_idle_robot_is_lost_by_the_middleware_and_that_of_a_busy_one_is_not(
    tmp_path: Path,
) -> None:
    result = run_with_a_stranger(tmp_path, lambda node, seen: [], time={"straggler_s": 2.0})
    assert result.outcome == "failed"
    assert result.reason == "tick 0: no command from node 0 within 2 s"
    assert result.middleware_lost == 1
