"""Links: tests of both implementations, then tests of the link between processes."""

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest
from network import NIL, RUN, Network, ask, hello, network
from support import stop
from waiting import until

from zwerm.agents.runtime.contract import Setup
from zwerm.deploy.swarm import LocalSwarm
from zwerm.errors import LinkError
from zwerm.link import Answer, Arrival, WorldLink
from zwerm.link.admission import ExpectedNode
from zwerm.link.memory import MemoryLink
from zwerm.link.software import software
from zwerm.wire.keys import command_key
from zwerm.wire.messages import (
    MESSAGE_BYTES_MAX,
    Command,
    Goodbye,
    Hello,
    Observation,
    Packet,
    Welcome,
    decode_to_node,
    decode_welcome,
    encode,
    open_answer,
)
from zwerm.wire.refusals import Refusals

NODES = range(3)
Open = Callable[[Answer], WorldLink]


@pytest.fixture(params=["memory", "zenoh"])
def open_link(request: pytest.FixtureRequest, private_tmp: Path) -> Iterator[Open]:
    """Open the world's end of a link to three nodes, each of which is a function from message to message."""
    with contextlib.ExitStack() as stack:

        def open_memory(answer: Answer) -> WorldLink:
            return MemoryLink(dict.fromkeys(NODES, answer))

        def open_zenoh(answer: Answer) -> WorldLink:
            net = stack.enter_context(network(private_tmp))
            for number in NODES:
                node = stack.enter_context(contextlib.closing(net.node(number)))
                node.join()
                send = node.send
                node.listen(partial(lambda send, payload: send(answer(payload)), send))
            return net.link

        yield open_memory if request.param == "memory" else open_zenoh


def take(link: WorldLink, count: int) -> dict[int, list[bytes]]:
    """Receive `count` messages, and return them by node in the order received."""
    taken: dict[int, list[bytes]] = {node: [] for node in NODES}
    for _ in range(count):
        arrival = link.receive(20.0)
        assert arrival is not None
        assert arrival.payload is not None
        taken[arrival.node].append(arrival.payload)
    return taken


def test_messages_of_each_node_arrive_in_order_and_exactly_once(open_link: Open) -> None:
    link = open_link(lambda payload: b"answer " + payload)
    count, burst = 2_000, 100  # a burst fits the queues: these nodes answer in the thread that receives for the world
    taken: dict[int, list[bytes]] = {node: [] for node in NODES}
    for first in range(0, count, burst):
        for number in range(first, first + burst):
            for node in NODES:
                link.send(node, f"{node} {number}".encode())
        for node, payloads in take(link, burst * len(NODES) // 2).items():
            taken[node] += payloads
        while missing := (first + burst) * len(NODES) - sum(map(len, taken.values())):
            for node, payload in link.receive_many(min(100, missing), 20.0):
                assert payload is not None
                taken[node].append(payload)
    for node in NODES:
        assert taken[node] == [f"answer {node} {number}".encode() for number in range(count)]
    assert link.receive(0.05) is None


@pytest.mark.parametrize("size", [0, 1, 65_000, 65_535, MESSAGE_BYTES_MAX, 5 * MESSAGE_BYTES_MAX])
def test_a_message_of_any_size_arrives_as_it_was_sent(open_link: Open, size: int) -> None:
    link = open_link(lambda payload: payload[::-1])
    payload = bytes(number % 251 for number in range(size))
    for node in NODES:
        link.send(node, payload)
    assert take(link, len(NODES)) == {node: [payload[::-1]] for node in NODES}


def test_without_messages_receive_returns_none(open_link: Open) -> None:
    link = open_link(bytes)
    assert link.receive_many(1, 0.05) == []
    assert link.receive(0.0) is None
    assert link.receive(0.05) is None


def test_closing_a_link_twice_is_allowed(open_link: Open) -> None:
    link = open_link(bytes)
    link.send(0, b"x")
    link.close()
    link.close()


def test_a_node_in_memory_answers_when_its_answer_is_collected_and_not_when_it_is_sent_something() -> None:
    answered: list[bytes] = []
    link = MemoryLink({0: lambda payload: answered.append(payload) or payload, 1: bytes})
    link.send(0, b"a")
    link.send(1, b"b")
    assert answered == []
    link.kill(1)
    assert link.receive_many(2, 0.0) == [Arrival(1, None), Arrival(0, b"a")]
    assert answered == [b"a"]


# --- between processes ----------------------------------------------------------------------------------------------


@pytest.fixture
def net(private_tmp: Path) -> Iterator[Network]:
    with network(private_tmp) as opened:
        yield opened


def test_receive_waits_for_its_own_timeout_after_a_longer_one(net: Network) -> None:
    node = net.node(0)
    node.join()
    threading.Timer(0.1, node.send, [b"x"]).start()
    assert net.link.receive(60.0) == Arrival(0, b"x")
    began_s = time.monotonic()
    assert net.link.receive(0.2) is None
    assert time.monotonic() - began_s >= 0.2
    node.close()


def test_receive_many_returns_after_enough_messages_or_the_loss_of_a_node(net: Network) -> None:
    node = net.node(0)
    node.join()
    for number in range(3):
        threading.Timer(0.02 * number, node.send, [bytes([number])]).start()
    assert net.link.receive_many(3, 60.0) == [Arrival(0, bytes([number])) for number in range(3)]
    began_s = time.monotonic()
    assert net.link.receive_many(1, 0.1) == []
    assert time.monotonic() - began_s >= 0.1
    node.send(b"last words")
    threading.Timer(0.1, node.close).start()
    with ThreadPoolExecutor() as pool:
        early = pool.submit(net.link.receive_many, 3, 300.0)
        assert early.result(timeout=60.0) == [Arrival(0, b"last words"), Arrival(0, None)], "the loss ends the wait"
    assert net.link.receive_many(1, 0.1) == [], "a loss ends one wait only"


def test_a_node_that_sends_faster_than_the_world_receives_is_blocked(
    private_tmp: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("zwerm.link.world_link.CAPACITY", 10)
    sent = [str(number).encode() for number in range(100)]
    with network(private_tmp) as net:
        node = net.node(0)
        node.join()
        for payload in sent:
            node.send(payload)
        until(lambda: len(net.link._arrivals) == 10, "full")
        assert [net.link.receive(20.0) for _ in sent] == [Arrival(0, payload) for payload in sent]
        assert net.link.receive(0.0) is None
        node.close()


def test_receiving_from_a_closed_link_raises_an_error(net: Network) -> None:
    net.link.close()
    with pytest.raises(LinkError, match=r"^the world's link is closed"):
        net.link.receive(1.0)


HELLOS = {
    b"": "malformed",
    b"\xc1": "malformed",
    hello(0) + b"\x00": "malformed",
    hello(0)[:-1]: "malformed",
    b"\x80": "schema",
    hello(0).replace(b"hello/1", b"hello/2"): "version",
    encode(Command()): "schema",
    encode(Goodbye("x")): "not-joined",
    hello(1): "identity",
    hello(-1): "identity",
    hello(0, 2): "incarnation",
    hello(0, 0): "incarnation",
}


def test_a_wrong_hello_is_refused_and_counted_by_its_reason(net: Network) -> None:
    session = net.session(net.credentials.nodes[0])
    for payload, reason in HELLOS.items():
        net.link.refusals = Refusals()
        assert [decode_welcome(answer) for answer in ask(session, 0, payload)] == [Welcome(refused=reason)], payload
        assert net.link.refusals.by_reason == {reason: 1}
    assert net.link.joined == frozenset()
    assert [decode_welcome(answer).refused for answer in ask(session, 0, hello(0))] == [""]
    assert net.link.joined == {0}
    assert [decode_welcome(answer).refused for answer in ask(session, 0, hello(0))] == ["joined"]
    session.close()


def test_a_hello_of_an_unexpected_node_is_refused(private_tmp: Path) -> None:
    with network(private_tmp, members={0: ExpectedNode(1, "nobody", NIL)}) as net:
        node = net.node(1)
        with pytest.raises(LinkError, match=r"^node 1 at unixsock-stream/.*: the world refuses it: unknown: "):
            node.join()
        node.close()
        assert net.link.refusals.by_reason == {"unknown": 1}


def test_a_command_of_a_node_that_has_not_joined_is_counted_and_discarded(net: Network) -> None:
    session = net.session(net.credentials.nodes[0])
    session.put(command_key(RUN, 0), b"early")
    ask(session, 0, hello(0, 9))  # answered after the command has arrived
    assert net.link.receive(0.0) is None
    assert net.link.refusals.by_reason == {"not-joined": 1, "incarnation": 1}
    ask(session, 0, hello(0))
    session.put(command_key(RUN, 0), b"later")
    assert net.link.receive(20.0) == Arrival(0, b"later")
    session.close()


def test_a_node_that_has_not_joined_cannot_block_the_world(net: Network) -> None:
    session = net.session(net.credentials.nodes[0])
    over = threading.Event()

    def flood() -> None:
        while not over.is_set():
            session.put(command_key(RUN, 0), b"let me in")

    with ThreadPoolExecutor() as pool:
        flooding = pool.submit(flood)
        try:
            assert pool.submit(net.link.receive, 0.2).result(timeout=60.0) is None
            assert not flooding.done(), "the world returned while messages still came"
        finally:
            over.set()
    assert net.link.refusals.by_reason["not-joined"] > 0
    session.close()


def test_a_message_to_a_joining_node_is_not_lost(net: Network) -> None:
    node = net.node(0)
    node.join()
    for number in range(100):
        net.link.send(0, bytes([number]))
    heard: list[bytes] = []
    done = threading.Event()
    node.listen(lambda payload: (heard.append(payload), done.set() if len(heard) == 100 else None))
    assert done.wait(20.0)
    assert heard == [bytes([number]) for number in range(100)]
    node.close()


def test_python_keeps_the_state_of_zenohs_thread_between_messages(net: Network) -> None:
    node = net.node(0)
    node.join()
    own, threads, counts = threading.local(), set(), []

    def count(payload: bytes) -> None:
        own.count = getattr(own, "count", 0) + 1
        threads.add(threading.get_ident())
        counts.append(own.count)

    node.listen(count)
    for _ in range(200):
        net.link.send(0, b"x")
    until(lambda: len(counts) == 200, "200 messages")
    assert counts.count(1) == len(threads) < 200
    node.close()


def test_a_dismissed_node_receives_goodbye_and_is_not_reported_lost(net: Network) -> None:
    node, other = net.node(0), net.node(1)
    node.join()
    other.join()
    net.link.dismiss("enough")
    payload = node.receive(20.0)
    assert payload is not None
    assert decode_to_node(payload) == Goodbye("enough")
    node.close()
    assert net.link.wait_joined(lambda joined: set(joined) == {1}, 20.0)
    other.send(b"last words")
    assert net.link.receive(20.0) == Arrival(1, b"last words")
    assert net.link.receive(0.0) is None
    other.close()


def test_all_messages_before_a_confirmed_goodbye_arrive_and_the_node_can_join_again(net: Network) -> None:
    node = net.node(0)
    node.join()
    for number in range(500):
        node.send(str(number).encode())
    heard = threading.Event()
    node.send_goodbye("tired", heard.set)
    assert heard.wait(20.0)
    node.close()
    for number in range(500):
        assert net.link.receive(20.0) == Arrival(0, str(number).encode())
    assert net.link.receive(20.0) == Arrival(0, None)
    again = net.node(1)
    again.join()
    with pytest.raises(LinkError, match=r"^node 1 is still joined as incarnation 1$"):
        net.link.expect(1, ExpectedNode(2, "nobody", NIL))
    net.link.expect(0, ExpectedNode(2, "nobody", NIL))
    stale = net.node(0)
    with pytest.raises(LinkError, match="refuses it: incarnation"):
        stale.join()
    stale.close()
    again.close()


def test_a_goodbye_is_confirmed_only_when_the_world_answers(net: Network) -> None:
    node = net.node(0)
    node.join()
    node.send(b"last words")
    heard = threading.Event()
    with net.link._lock:  # the world can neither confirm nor take note of a loss
        node.send_goodbye("tired", heard.set)
        assert not heard.wait(0.2)
    assert heard.wait(20.0)
    node.close()
    assert [net.link.receive(20.0) for _ in range(2)] == [Arrival(0, b"last words"), Arrival(0, None)]
    heard.clear()
    node.send_goodbye("again", heard.set)
    assert heard.is_set(), "closing the link confirms a goodbye"


def test_closing_the_link_ends_the_wait_for_a_confirmation(net: Network) -> None:
    node = net.node(0)
    node.join()
    heard = threading.Event()
    with net.link._lock:
        node.send_goodbye("tired", heard.set)
        node.close()
        assert heard.wait(20.0)


def test_a_node_is_informed_when_the_world_is_lost(private_tmp: Path) -> None:
    gone = threading.Event()
    with network(private_tmp) as net:
        node = net.node(0, on_lost=gone.set)
        node.join()
    assert gone.wait(20.0)
    node.close()


def test_the_router_discards_a_message_above_its_size_limit(net: Network) -> None:
    node = net.node(0)
    node.join()
    node.send(bytes(20 * MESSAGE_BYTES_MAX))
    node.send(b"short")
    assert net.link.receive(20.0) == Arrival(0, b"short")
    node.close()


def echo_swarm(count: int) -> LocalSwarm:
    members = {node: ("small_controllers:Echo", Setup(node, "robot", 0.1, (), bytes(16))) for node in range(count)}
    return LocalSwarm(RUN, members)


def said(link: WorldLink, node: int, tick: int) -> Arrival | None:
    """Send the node an observation, and return what arrives next."""
    link.send(node, encode(Observation(tick, 0.0, (Packet("a", b"x"),))))
    return link.receive(20.0)


def test_a_killed_process_is_reported_lost_and_restarts_as_a_new_incarnation(nothing_left: None) -> None:
    with echo_swarm(3) as swarm:
        assert said(swarm.link, 1, 0) is not None
        swarm.supervisor.kill(1)
        assert swarm.link.receive(20.0) == Arrival(1, None)
        assert swarm.link.joined == {0, 2}
        assert swarm.supervisor.exit_codes == {1: -signal.SIGKILL}
        swarm.restart(1)
        answer = said(swarm.link, 1, 7)
        assert answer is not None
        assert answer.payload is not None
        assert open_answer(answer.payload).tick == 7
        swarm.restart(2)
        assert swarm.link.receive(20.0) == Arrival(2, None)
        assert swarm.link.refusals.by_reason == {}
    assert set(swarm.supervisor.exit_codes.values()) == {0}


def test_a_paused_process_is_not_lost_and_answers_after_it_resumes(nothing_left: None) -> None:
    with echo_swarm(2) as swarm:
        stop(swarm.supervisor.pids[0])
        swarm.link.send(0, encode(Observation(3, 0.0)))
        answer = said(swarm.link, 1, 3)
        assert answer is not None
        assert answer.node == 1
        assert swarm.link.receive(0.1) is None
        swarm.supervisor.send_signal(0, signal.SIGCONT)
        answer = swarm.link.receive(20.0)
        assert answer is not None
        assert answer.node == 0
        assert answer.payload is not None


def test_a_lost_node_gets_the_reason_for_which_it_is_not_admitted_again(net: Network) -> None:
    node, other = net.node(0), net.node(1)
    node.join()
    other.join()
    node.close()
    assert net.link.receive(20.0) == Arrival(0, None)
    again = net.node(0)
    with pytest.raises(LinkError, match=r"refuses it: returned: the run has given it up as lost"):
        again.join()
    again.send(b"I am still here")
    other.send(b"control")
    assert net.link.receive(20.0) == Arrival(1, b"control")
    assert net.link.joined == {1}
    assert net.link.refusals.by_reason["returned"] == 1
    again.close()
    other.close()


def test_a_node_with_other_releases_gets_both_lists_of_releases(net: Network) -> None:
    session = net.session(net.credentials.nodes[0])
    [answer] = ask(session, 0, encode(Hello(0, 1, "zwerm 9.9")))
    welcome = decode_welcome(answer)
    assert welcome.refused == "software"
    assert welcome.detail == f"the world has {software()}; the node has zwerm 9.9"
    assert software().startswith("zwerm ")
    assert "numpy " in software()
    [answer] = ask(session, 0, encode(Hello(0, 1, software())))
    assert decode_welcome(answer).refused == ""
    session.close()
