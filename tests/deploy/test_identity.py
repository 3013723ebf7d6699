"""Credentials and access control: a node can use its own keys and nothing else."""

import contextlib
import os
import socket
import stat
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
import zenoh
from network import RUN, Network, ask, hello, network
from support import children_of

from zwerm.agents.runtime.contract import Setup
from zwerm.deploy.identity import ACCEPT_TIMEOUT_MS, issue, load, save, slice_of
from zwerm.deploy.swarm import LocalSwarm
from zwerm.errors import LinkError
from zwerm.link import Arrival
from zwerm.link.node_link import ZenohNodeLink
from zwerm.wire.keys import alive_key, command_key, observation_key
from zwerm.wire.messages import Welcome, decode_welcome

VICTIM, INTRUDER = 0, 1


@pytest.fixture
def net(private_tmp: Path) -> Iterator[Network]:
    with network(private_tmp) as opened:
        yield opened


@pytest.fixture
def victim(net: Network) -> Iterator[ZenohNodeLink]:
    """A node that has joined and behaves well."""
    with contextlib.closing(net.node(VICTIM)) as node:
        node.join()
        yield node


@pytest.fixture
def intruder(net: Network) -> Iterator[zenoh.Session]:
    """A session with the valid credentials of another node, which has joined."""
    with net.session(net.credentials.nodes[INTRUDER]) as session:
        ask(session, INTRUDER, hello(INTRUDER))
        yield session


def after_all_before(net: Network, session: zenoh.Session) -> None:
    """Wait until the world has received everything that `session` sent: its next command arrives after that."""
    session.put(command_key(RUN, INTRUDER), b"control")
    assert net.link.receive(20.0) == Arrival(INTRUDER, b"control")


@pytest.mark.parametrize("key", ["**", "zwerm/**", f"zwerm/{RUN}/node/*/obs", observation_key(RUN, VICTIM)])
def test_a_node_receives_no_other_nodes_observations(
    net: Network, victim: ZenohNodeLink, intruder: zenoh.Session, key: str
) -> None:
    heard: list[tuple[str, bytes]] = []
    own = intruder.declare_subscriber(observation_key(RUN, INTRUDER))
    intruder.declare_subscriber(
        key,
        lambda sample: heard.append((str(sample.key_expr), sample.payload.to_bytes())),
        allowed_origin=zenoh.Locality.REMOTE,
    )
    ask(intruder, INTRUDER, hello(INTRUDER))  # so the router has the subscriptions, for what it makes of them
    net.link.send(VICTIM, b"secret")
    victim.send(b"secret command")
    assert victim.receive(20.0) == b"secret"
    assert net.link.receive(20.0) == Arrival(VICTIM, b"secret command")
    net.link.send(INTRUDER, b"control")
    assert own.recv().payload.to_bytes() == b"control"
    assert [payload for _, payload in heard if payload != b"control"] == []


def test_a_node_cannot_send_commands_as_another_node(
    net: Network, victim: ZenohNodeLink, intruder: zenoh.Session
) -> None:
    intruder.put(command_key(RUN, VICTIM), b"forged command")
    intruder.put(observation_key(RUN, VICTIM), b"forged observation")
    intruder.put(f"zwerm/{RUN}/node/*/cmd", b"forged for all")
    intruder.put(command_key(RUN, "nobody"), b"forged for nobody")
    intruder.delete(command_key(RUN, INTRUDER))
    after_all_before(net, intruder)
    assert victim.receive(0.0) is None
    assert net.link.refusals.by_reason == {}
    victim.send(b"real")
    assert net.link.receive(20.0) == Arrival(VICTIM, b"real")


def test_a_node_cannot_answer_hello_as_the_world_or_send_hello_as_another_node(
    net: Network, victim: ZenohNodeLink, intruder: zenoh.Session
) -> None:
    asked: list[str] = []

    def answer(query: zenoh.Query) -> None:
        asked.append(str(query.key_expr))
        query.drop()

    intruder.declare_queryable(f"zwerm/{RUN}/hello/*", answer, allowed_origin=zenoh.Locality.REMOTE)
    assert ask(intruder, 2, hello(2)) == []
    after_all_before(net, intruder)
    with contextlib.closing(net.node(2)) as node:
        assert node.join().refused == ""
    assert asked == []


def test_a_node_cannot_declare_or_withdraw_another_nodes_liveliness_token(
    net: Network, victim: ZenohNodeLink, intruder: zenoh.Session
) -> None:
    seen: list[str] = []
    intruder.liveliness().declare_subscriber(
        f"zwerm/{RUN}/alive/*", lambda sample: seen.append(str(sample.key_expr)), history=True
    )
    after_all_before(net, intruder)
    assert seen == []
    token = intruder.liveliness().declare_token(alive_key(RUN, VICTIM))
    own = intruder.liveliness().declare_token(alive_key(RUN, INTRUDER))
    token.undeclare()
    after_all_before(net, intruder)
    assert net.link.joined == {VICTIM, INTRUDER}
    victim.send(b"alive")
    assert net.link.receive(20.0) == Arrival(VICTIM, b"alive")
    own.undeclare()
    assert net.link.receive(20.0) == Arrival(INTRUDER, None)


def test_a_session_with_a_wrong_password_is_refused(net: Network) -> None:
    right = net.credentials.nodes[INTRUDER]
    for wrong in (
        None,
        msgspec.structs.replace(right, password="guess"),
        msgspec.structs.replace(right, user="node-9"),
        msgspec.structs.replace(right, password=net.credentials.nodes[VICTIM].password),
    ):
        with pytest.raises(LinkError, match=r"^no session: "):
            net.session(wrong)
    with net.session(right) as session:
        assert [decode_welcome(reply).refused for reply in ask(session, INTRUDER, hello(INTRUDER))] == [""]
    assert net.link.refusals.by_reason == {}


def test_a_refused_node_gets_an_error_of_one_line(net: Network) -> None:
    wrong = msgspec.structs.replace(net.credentials.nodes[0], password="guess")
    with pytest.raises(LinkError) as refused:
        ZenohNodeLink(RUN, wrong, net.endpoint, deadline_s=0.5)
    line = str(refused.value)
    assert line.startswith(f"node 0 at {net.endpoint}: no world answers there, or it does not take these credentials")
    assert "\n" not in line


def test_credentials_from_a_session_with_another_zenoh_id_have_no_permissions(
    net: Network, victim: ZenohNodeLink
) -> None:
    stolen = net.credentials.nodes[VICTIM]
    heard: list[bytes] = []
    with net.session(msgspec.structs.replace(stolen, zid="abc")) as twin:
        twin.declare_subscriber(observation_key(RUN, VICTIM), lambda sample: heard.append(sample.payload.to_bytes()))
        twin.put(command_key(RUN, VICTIM), b"forged")
        assert ask(twin, VICTIM, hello(VICTIM)) == []
        net.link.send(VICTIM, b"secret")
        assert victim.receive(20.0) == b"secret"
    assert heard == []
    assert net.link.receive(0.0) is None
    assert net.link.joined == {VICTIM}


def test_a_second_session_with_the_same_credentials_is_refused_and_the_first_stays(
    net: Network, victim: ZenohNodeLink
) -> None:
    with pytest.raises(LinkError, match=r"^no session: "):
        net.session(net.credentials.nodes[VICTIM])
    net.link.send(VICTIM, b"still there?")
    assert victim.receive(20.0) == b"still there?"
    victim.send(b"yes")
    assert net.link.receive(20.0) == Arrival(VICTIM, b"yes")


def test_a_second_hello_of_a_joined_node_is_refused_and_counted(net: Network, intruder: zenoh.Session) -> None:
    assert [decode_welcome(reply) for reply in ask(intruder, INTRUDER, hello(INTRUDER))] == [Welcome(refused="joined")]
    assert net.link.refusals.by_reason == {"joined": 1}
    after_all_before(net, intruder)


def test_each_run_has_its_own_credentials() -> None:
    first, second = issue(RUN, range(50)), issue(RUN, range(50))
    for field in ("password", "zid"):
        values = [getattr(node, field) for node in (*first.nodes, *second.nodes)]
        assert len(set(values)) == 100, field
        assert min(map(len, values)) >= 31, field


def test_credentials_are_equal_after_saving_and_loading_a_private_file(tmp_path: Path) -> None:
    path = tmp_path / "keys"
    some = slice_of(issue(RUN, range(9), "PEM"), [2, 5])
    save(some, path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert load(path) == some
    assert [node.node for node in some.nodes] == [2, 5]


def test_a_bad_credentials_file_is_an_error_of_one_line(tmp_path: Path) -> None:
    path = tmp_path / "keys"
    with pytest.raises(LinkError, match=r"keys: cannot read credentials: No such file or directory$"):
        load(path)
    save(issue(RUN, [0]), path)
    with pytest.raises(LinkError, match=r"keys: cannot write credentials: File exists$"):
        save(issue(RUN, [0]), path)
    path.chmod(0o640)
    with pytest.raises(LinkError, match=r"keys: credentials must be readable by their owner only \(chmod 600\)$"):
        load(path)
    path.chmod(0o600)
    path.write_text("{")
    with pytest.raises(LinkError, match=r"keys: no credentials: "):
        load(path)
    with pytest.raises(LinkError, match=r"^.*/none/keys: cannot write credentials: No such file or directory$"):
        save(issue(RUN, [0]), tmp_path / "none" / "keys")
    with pytest.raises(LinkError, match=r"^the credentials hold no node 3$"):
        slice_of(issue(RUN, [0]), [3])


def test_no_secret_is_on_a_command_line_in_an_environment_or_in_a_file(nothing_left: None, private_tmp: Path) -> None:
    members = {node: ("small_controllers:Echo", Setup(node, "robot", 0.1, (), bytes(16))) for node in range(2)}
    with LocalSwarm(RUN, members) as swarm:
        secrets = [secret.encode() for node in swarm.credentials.nodes for secret in (node.password, node.zid)]
        robots = set(swarm.supervisor.pids.values())
        servers = {pid for pid in children_of(os.getpid()) if children_of(pid) & robots}
        assert servers, "the server that forked them is found"
        for pid in robots | servers:
            for name in ("cmdline", "environ"):
                try:
                    seen = Path(f"/proc/{pid}/{name}").read_bytes()
                except PermissionError:  # a robot's environment is closed to its own user
                    continue
                assert seen or name == "environ"
                assert not any(secret in seen for secret in secrets), (pid, name)
        (directory,) = private_tmp.glob("zwerm-*")
        assert stat.S_IMODE(directory.stat().st_mode) == 0o700
        files = [path for path in directory.iterdir() if path.is_file()]
        assert not any(secret in path.read_bytes() for path in files for secret in secrets)
        assert "passwords" not in {path.name for path in directory.iterdir()}


def test_silent_connections_do_not_prevent_a_node_from_joining(private_tmp: Path) -> None:
    with network(private_tmp) as net, contextlib.ExitStack() as open_sockets:
        for _ in range(400):  # two descriptors each, of the 1,024 that a process usually has
            idle = open_sockets.enter_context(socket.socket(socket.AF_UNIX))
            idle.connect(net.endpoint.partition("/")[2])
        # The deadline is shorter than the time that the router gives such a connection.
        own = net.credentials.nodes[0]
        with contextlib.closing(ZenohNodeLink(RUN, own, net.endpoint, deadline_s=ACCEPT_TIMEOUT_MS / 1_250)) as node:
            assert node.join().refused == ""
