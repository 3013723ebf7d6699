"""Runs over a network with certificates on both sides: the admitted hosts, and the content of each host's file."""

import subprocess
import tempfile
import threading
from pathlib import Path

import msgspec
import pytest
from command_line import zwerm
from network import free_port, tick
from waiting import until

from zwerm.agents.runtime.contract import Setup
from zwerm.deploy.endpoints import check_encryption
from zwerm.deploy.host_keys import slices_of, write_host_keys
from zwerm.deploy.identity import load, load_world_keys
from zwerm.deploy.remote import parse_ids, run_robots
from zwerm.deploy.supervisor import prepare
from zwerm.deploy.swarm import RemoteSwarm
from zwerm.errors import LinkError
from zwerm.link.admission import ExpectedNode
from zwerm.link.node_link import ZenohNodeLink
from zwerm.link.session import Credential, Terms
from zwerm.wire.messages import Failure, open_answer

ECHO = "small_controllers:Echo"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "keys"
    paths = write_host_keys(folder, range(4), ["localhost"], ["left=0-1", "right=2,3"], 10.0)
    assert [path.name for path in paths] == ["world.key", "left.key", "right.key"]
    return folder


def members() -> dict[int, tuple[str, Setup]]:
    return {node: (ECHO, Setup(node, "robot", 0.1, (), bytes(16))) for node in range(4)}


def test_each_file_holds_the_secrets_of_its_own_host_only(keys: Path) -> None:
    left, right, world = load(keys / "left.key"), load(keys / "right.key"), load_world_keys(keys / "world.key")
    assert [node.node for node in left.nodes] == [0, 1]
    text = (keys / "left.key").read_text()
    for node in right.nodes:
        for secret in (node.password, node.zid, node.key_pem):
            assert secret not in text
    assert world.identity.key_pem not in text
    assert not any(node.key_pem for node in world.credentials.nodes), "the world needs no private key of a node"
    assert "PRIVATE KEY" not in "".join(path.read_text() for path in keys.iterdir() if path.suffix == ".pem")
    for path in keys.iterdir():
        assert path.stat().st_mode & 0o777 == 0o600
    certificate = Path(tempfile.mkdtemp()) / "own.pem"
    certificate.write_text(right.nodes[0].certificate_pem)
    named = subprocess.run(
        ["openssl", "x509", "-in", certificate, "-noout", "-subject"], capture_output=True, text=True, check=True
    )
    assert named.stdout.split("=")[-1].strip() == "node-2"


@pytest.mark.parametrize("protocol", ["tls", "quic"])
def test_two_hosts_join_with_their_own_files_and_no_other_host_does(
    keys: Path, protocol: str, nothing_left: None
) -> None:
    endpoint = f"{protocol}/localhost:{free_port()}"
    left = load(keys / "left.key")
    other = load(keys / "right.key").nodes[0]
    own = left.nodes[0]
    codes: dict[int, int] = {}
    errors: list[str] = []
    listening, refused = threading.Event(), threading.Event()

    def robots() -> None:
        listening.wait(20.0)
        for terms, wrong in (
            (left.terms, msgspec.structs.replace(own, certificate_pem="", key_pem="")),
            (Terms(), own),  # it does not know the authority
        ):
            errors.append(_reason(left.run, wrong, endpoint, terms))
        # Somebody with the password of node 0 and the certificate of node 2 connects, and may use no key of node 0.
        stolen = msgspec.structs.replace(own, certificate_pem=other.certificate_pem, key_pem=other.key_pem)
        errors.append(_reason(left.run, stolen, endpoint, left.terms))
        refused.set()
        with_left = threading.Thread(
            target=lambda: codes.update(run_robots(endpoint, keys / "left.key", deadline_s=20.0))
        )
        with_left.start()
        codes.update(run_robots(endpoint, keys / "right.key", deadline_s=20.0))
        with_left.join()

    prepare(4)  # the server of robots ends with the thread that starts it
    starting = threading.Thread(target=robots)
    starting.start()
    swarm = RemoteSwarm("run", members(), listen=[endpoint], keys=load_world_keys(keys / "world.key"), progress=None)
    opened = swarm._open

    def open_and_tell(directory: Path) -> None:
        opened(directory)
        listening.set()

    swarm._open = open_and_tell  # type: ignore[method-assign]
    with swarm:
        assert refused.is_set()
        assert set(tick(swarm.link, range(4), 0)) == {0, 1, 2, 3}
    starting.join(20.0)
    assert codes == dict.fromkeys(range(4), 0)
    assert [("no world answers there" in each) or ("did not answer hello" in each) for each in errors] == [True] * 3, (
        errors
    )


def _reason(run: str, credential: Credential, endpoint: str, terms: Terms) -> str:
    """Return why a node cannot join."""
    try:
        link = ZenohNodeLink(run, credential, endpoint, terms=terms, deadline_s=1.5)
    except LinkError as error:
        return str(error)
    try:
        link.join()
    except LinkError as error:
        return str(error)
    finally:
        link.close()
    return "it joined"


@pytest.mark.parametrize(
    "endpoint", ["tcp/0.0.0.0:7447", "tcp/192.0.2.1:7447", "tcp/[::]:7447", "tcp/example.org:7447"]
)
def test_an_endpoint_without_encryption_beyond_the_machine_needs_an_option(endpoint: str, tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="expected tls/ or quic/ beyond this machine"):
        check_encryption([endpoint])
    check_encryption(["tls/0.0.0.0:1", "quic/0.0.0.0:1", "tcp/127.0.0.1:1", "tcp/[::1]:1", "tcp/localhost:1"])


def test_the_command_line_needs_plain_for_tcp_beyond_the_machine(tmp_path: Path) -> None:
    ran = zwerm("world", "gossip-max", "--listen", "tcp/0.0.0.0:1", "--credentials", "new.key", cwd=tmp_path)
    assert ran.returncode == 2
    assert "zwerm: tcp/0.0.0.0:1: expected tls/ or quic/ beyond this machine" in ran.stderr
    assert list(tmp_path.iterdir()) == []


def test_credentials_for_tls_are_not_used_over_tcp(keys: Path) -> None:
    with pytest.raises(LinkError, match=r"these credentials are for a tls/ or quic/ endpoint"):
        run_robots("tcp/192.0.2.1:7447", keys / "left.key")


@pytest.mark.parametrize(
    ("hosts", "error"),
    [
        (["a=0-1"], "no host has node 2"),
        (["a=0-3", "b=3"], "has no node 3, or another host has it"),
        (["a=0-9"], "has no node 4"),
        (["world=0-3"], "expected a new name"),
        (["../x=0-3"], "expected a new name"),
        (["a"], "expected a new name"),
        (["a=0-999999999999"], "^--host a: expected ids of at most 99999"),
        (["a=\u00b2"], "^--host a: expected ids such as 3"),  # a digit that is no decimal
        (["a=3-1"], "^--host a: expected ids such as 3"),
    ],
)
def test_hosts_that_do_not_fit_the_run_are_an_error_of_one_line(hosts: list[str], error: str) -> None:
    with pytest.raises(LinkError, match=error):
        slices_of(range(4), hosts)


@pytest.mark.parametrize("ids", ["0-999999999999", "9" * 5_000, "0-" + "9" * 5_000])
def test_ids_without_end_are_refused(ids: str) -> None:
    with pytest.raises(LinkError, match=r"^--ids: expected ids of at most 99999, got '.{1,90}$"):
        parse_ids(ids)


def test_a_folder_that_exists_gets_no_keys(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="cannot make a new folder: File exists"):
        write_host_keys(tmp_path, range(2), [], [], 10.0)


def test_a_host_with_another_file_of_the_controller_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, nothing_left: None
) -> None:
    other = msgspec.structs.replace(ExpectedNode(1, ECHO, b"\xc0"), code="0" * 32)
    monkeypatch.setattr(RemoteSwarm, "_member", lambda self, credential: other)
    credentials, endpoint = tmp_path / "robots.key", f"tcp/127.0.0.1:{free_port()}"
    prepare(1)
    codes: dict[int, int] = {}
    errors: list[str] = []

    def robot() -> None:
        until(lambda: credentials.exists() and credentials.stat().st_size, "credentials written")
        try:
            codes.update(run_robots(endpoint, credentials, "0", deadline_s=20.0))
        except LinkError as error:
            errors.append(str(error))

    starting = threading.Thread(target=robot)
    starting.start()
    with RemoteSwarm("run", {0: members()[0]}, listen=[endpoint], credentials_file=credentials) as swarm:
        said = swarm.link.receive(20.0)
        assert said is not None
        failure = open_answer(said.payload or b"")
        assert isinstance(failure, Failure)
        assert failure.error == f"{ECHO}: its file here differs from the world's; install the same on both"
        starting.join(20.0)
    assert errors == ["node 0 ended with exit code 2 before it joined"]
