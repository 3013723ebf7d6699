"""A swarm behind one link: its credentials, its router, and its processes, on this machine or on others.

    with LocalSwarm(run, members) as swarm:
        swarm.link.send(...); swarm.link.receive(...)

Entering returns when every node has joined. Leaving, also by an exception, leaves no process, socket or directory.
"""

import contextlib
import secrets
import signal
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Final, NamedTuple, Self

import msgspec

from zwerm.agents.runtime.confinement import UNCONFINED, Confinement
from zwerm.agents.runtime.contract import Setup
from zwerm.agents.runtime.controllers import code_of
from zwerm.deploy.authority import certify
from zwerm.deploy.endpoints import host_of, is_encrypted
from zwerm.deploy.heap_memory import return_freed, share_heaps
from zwerm.deploy.identity import (
    PROBE,
    SECRET_BYTES,
    WorldIdentity,
    WorldKeys,
    issue,
    renew,
    router_settings,
    save,
    slice_of,
)
from zwerm.deploy.runtime_directory import private_directory
from zwerm.deploy.supervisor import (
    JOIN_DEADLINE_S,
    LEAVE_WAIT_S,
    LocalSupervisor,
    Progress,
    interrupts_held,
    prepare,
)
from zwerm.errors import ControllerError, LinkError
from zwerm.link.admission import ExpectedNode
from zwerm.link.peer_radio import Station
from zwerm.link.session import (
    LEASE_REMOTE_S,
    UNIX_PROTOCOL,
    Credential,
    Credentials,
    close_without_waiting,
    open_session,
)
from zwerm.link.world_link import ZenohWorldLink
from zwerm.wire.messages import encode

# Time in which the router must admit a probe.
PROBE_S_MAX: Final = 5.0

Members = Mapping[int, tuple[str, Setup]]

# Called with the node (or -1) and the reason of each refusal by the link.
RefusalListener = Callable[[int, str], object]

# From a node's id and incarnation to its controller and Setup.
RestartSpec = Callable[[int, int], tuple[str, Setup]]


class Certificate(NamedTuple):
    """The world's certificate for TLS and QUIC endpoints, its key, and the authority that signed it: PEM files."""

    certificate: Path
    private_key: Path
    authority: Path

    def identity(self) -> WorldIdentity:
        """Return the identity that these files hold. Nodes need no certificates. Raises OSError."""
        certificate, key, authority = (each.read_text() for each in self)
        return WorldIdentity(certificate, key, authority, mutual=False)


class _Swarm(ABC):
    """The nodes of `members` (controller and Setup by node id), and the link to them, from enter to exit."""

    link: ZenohWorldLink
    credentials: Credentials
    _processes: Callable[[], Collection[int]] | None = None

    def __init__(
        self,
        run: str,
        members: Members,
        progress: Progress | None,
        deadline_s: float,
        paced: bool,
        on_refusal: RefusalListener | None,
    ) -> None:
        self._run = run
        self._on_refusal = on_refusal
        self._paced = paced
        self._members = members
        self._progress = progress or (lambda joined, total: None)
        self._deadline_s = deadline_s
        self._stack = contextlib.ExitStack()
        self._probed = ""  # the endpoint by which the router is probed
        self._probe_password = secrets.token_urlsafe(SECRET_BYTES)

    def __enter__(self) -> Self:
        """Start all nodes, and return when all have joined. Raises LinkError if one does not join."""
        try:
            with interrupts_held():
                self._open(self._stack.enter_context(private_directory()))
            self._gather()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End every node and release everything; idempotent."""
        with interrupts_held():
            self._stack.close()

    def _listen(self, directory: Path, endpoints: list[str], identity: WorldIdentity | None = None) -> None:
        """Open the world's end of the link on `endpoints`, for the nodes in `self.credentials`."""
        share_heaps()  # before the session starts its threads
        members = {credential.node: self._member(credential) for credential in self.credentials.nodes}
        passwords = directory / "passwords"
        settings = router_settings(self.credentials, endpoints, passwords, identity, self._probe_password)
        try:
            self.link = ZenohWorldLink(self._run, members, settings, self._processes)
        finally:
            passwords.unlink()
        if self._on_refusal is not None:
            self.link.refusals.listener = self._on_refusal
        self._stack.callback(self.link.close)

    def _member(self, credential: Credential) -> ExpectedNode:
        controller, setup = self._members[credential.node]
        return ExpectedNode(credential.incarnation, controller, encode(setup), self._paced, session=credential.zid)

    @contextlib.contextmanager
    def _joining(self) -> Iterator[None]:
        """Add to the error of a robot that does not join where the router takes no more sessions."""
        try:
            yield
        except LinkError as error:
            if self.takes_sessions():
                raise
            raise LinkError(f"{error}; the router takes no more sessions") from None

    def takes_sessions(self) -> bool:
        """Return whether the router admits one more session, within PROBE_S_MAX."""
        settings = {
            "mode": "client",
            "connect/endpoints": [self._probed],
            "connect/timeout_ms": round(1000 * PROBE_S_MAX),
            "connect/exit_on_failure": True,
            "transport/auth/usrpwd": {"user": PROBE, "password": self._probe_password},
        }
        try:
            open_session(settings, "probe").close()  # type: ignore[no-untyped-call]
        except LinkError:
            return False
        return True

    @abstractmethod
    def _open(self, directory: Path) -> None:
        """Open the link, and push the function that ends the nodes onto the exit stack."""

    @abstractmethod
    def _gather(self) -> None:
        """Return when every node has joined."""


class LocalSwarm(_Swarm):
    """A swarm of processes of this machine, reached by a Unix socket in a private directory."""

    supervisor: LocalSupervisor

    def __init__(
        self,
        run: str,
        members: Members,
        *,
        progress: Progress | None = None,
        order: Sequence[int] | None = None,
        deadline_s: float = JOIN_DEADLINE_S,
        paced: bool = False,
        late_joiners: Collection[int] = (),
        restart: RestartSpec | None = None,
        stations: Mapping[int, Station] | None = None,
        on_refusal: RefusalListener | None = None,
        confinement: Confinement = UNCONFINED,
    ) -> None:
        """`order` is the order of starting, `deadline_s` the time each process has to join, `paced` means real time.

        The nodes `late_joiners` start only when `start` is called. `restart` returns the controller and Setup of a node's
        next incarnation; without it they stay the same. Nodes in `stations` send packets over a real network.
        """
        super().__init__(run, members, progress, deadline_s, paced, on_refusal)
        self._order = [node for node in (members if order is None else order) if node not in late_joiners]
        self._restart = restart
        self._confinement = confinement
        self._stations = stations
        self._ran = set(self._order)
        self._stopped: set[int] = set()
        self._exit_wait_s = 0.0  # do not wait for nodes that have not joined

    def _open(self, directory: Path) -> None:
        prepare(len(self._members))
        endpoint = self._probed = f"{UNIX_PROTOCOL}/{directory}/router"
        self.credentials = issue(self._run, self._members)
        self.supervisor = LocalSupervisor(
            endpoint, self.credentials, order=self._order, stations=self._stations, confinement=self._confinement
        )
        self._processes = lambda: self.supervisor.pids.values()
        self._listen(directory, [endpoint])
        self._current = {credential.node: credential for credential in self.credentials.nodes}
        self._stack.callback(self._end)

    def _gather(self) -> None:
        with self._joining():
            self.supervisor.start(self._progress, self._deadline_s)
        self._exit_wait_s = LEAVE_WAIT_S

    def kill(self, node: int) -> None:
        """Kill a node with SIGKILL. The link then reports the node lost."""
        self._stopped.discard(node)
        self.supervisor.kill(node)

    def start(self, node: int) -> None:
        """Start a node that has not run yet or has ended, and return when it has joined. Raises LinkError if it does not.

        A node that has ended starts as a new incarnation, without its former state.
        """
        if node in self._ran:
            self._start_next_incarnation(node)
            return
        self._ran.add(node)
        with self._joining():
            self.supervisor.restart(self._current[node], self._deadline_s)

    def pause(self, node: int) -> None:
        """Stop a node's process with SIGSTOP."""
        self._stopped.add(node)
        self.supervisor.send_signal(node, signal.SIGSTOP)

    def resume(self, node: int) -> None:
        """Continue a stopped process with SIGCONT."""
        self._stopped.discard(node)
        self.supervisor.send_signal(node, signal.SIGCONT)

    def end_of(self, node: int, wait_s: float) -> str:
        """Return how a lost node's process ended, waiting for its end at most `wait_s`; "" where it runs on."""
        return self.supervisor.end_of(node, wait_s)

    def restart(self, node: int) -> None:
        """Kill a node, start its next incarnation without its former state, and return when it has joined.

        The link reports the killed incarnation as lost. Raises LinkError if the new one does not join.
        """
        self.kill(node)
        self._start_next_incarnation(node)

    def _start_next_incarnation(self, node: int) -> None:
        self.link.wait_joined(lambda joined: node not in joined, LEAVE_WAIT_S)
        credential = renew(self._current[node])
        if self._restart is not None:
            self._members = {**self._members, node: self._restart(node, credential.incarnation)}
        self.link.expect(node, self._member(credential))
        self._current[node] = credential
        with self._joining():
            self.supervisor.restart(credential, self._deadline_s)
        return_freed()

    def _end(self) -> None:
        for node in sorted(self._stopped):
            self.resume(node)
        self.link.dismiss("the run is over")
        self.supervisor.stop(self._exit_wait_s)


class RemoteSwarm(_Swarm):
    """A swarm with processes that are started elsewhere, with the credentials in the file `credentials_file`, or those
    of `keys`.

    Endpoints of TLS and QUIC get a new authority, and certificates for world and nodes, unless `keys` or `tls` say others.
    """

    def __init__(
        self,
        run: str,
        members: Members,
        *,
        listen: Sequence[str],
        credentials_file: Path | None = None,
        keys: WorldKeys | None = None,
        names: Sequence[str] = (),
        lease_s: float = LEASE_REMOTE_S,
        tls: Certificate | None = None,
        progress: Progress | None = None,
        deadline_s: float = JOIN_DEADLINE_S,
        paced: bool = False,
        on_refusal: RefusalListener | None = None,
    ) -> None:
        """`listen` are Zenoh endpoints, such as `tls/0.0.0.0:7447`. All nodes must join within `deadline_s`.

        `names` are further host names and addresses of this machine, for its certificate. A node is lost if its
        connection is silent for `lease_s`. Exactly one of `credentials_file` and `keys` is needed.
        """
        super().__init__(run, members, progress, deadline_s, paced, on_refusal)
        self._endpoints = list(listen)
        self._credentials_file = credentials_file
        self._keys = keys
        self._names = names
        self._lease_s = lease_s
        self._tls = tls

    def _open(self, directory: Path) -> None:
        self._probed = f"{UNIX_PROTOCOL}/{directory}/router"  # the world's own: it has no certificate of a node
        self._listen(directory, [*self._endpoints, self._probed], self._take_credentials())
        if self._credentials_file is not None:
            save(self.credentials, self._credentials_file)
            self._stack.callback(self._credentials_file.unlink, missing_ok=True)
        self._stack.callback(self._end)

    def _member(self, credential: Credential) -> ExpectedNode:
        controller, _ = self._members[credential.node]
        return msgspec.structs.replace(super()._member(credential), code=cached_code(controller))

    def _take_credentials(self) -> WorldIdentity | None:
        """Set the credentials, and return the identity for TLS and QUIC, if an endpoint needs one."""
        if self._keys is not None:
            self.credentials = slice_of(self._keys.credentials, self._members)
            self._run = self.credentials.run
            return self._keys.identity
        if self._tls is not None:
            identity = self._tls.identity()
            self.credentials = issue(self._run, self._members, identity.authority_pem, self._lease_s)
            return identity
        self.credentials = issue(self._run, self._members, lease_s=self._lease_s)
        if not any(is_encrypted(endpoint) for endpoint in self._endpoints):
            return None
        names = dict.fromkeys([*map(host_of, self._endpoints), *self._names, "localhost", socket.gethostname()])
        made, self.credentials = certify(self.credentials, list(names))
        return made

    def _gather(self) -> None:
        with self._joining():
            self._await_all()
        close_without_waiting()

    def _await_all(self) -> None:
        total = len(self._members)
        count = 0
        end_s = time.monotonic() + self._deadline_s
        while count < total:
            if not self.link.wait_joined(partial(_changed, count), end_s - time.monotonic()):
                missing = sorted(set(self._members) - self.link.joined)
                raise LinkError(
                    f"{len(missing)} nodes did not join within {self._deadline_s:g} s, first node {missing[0]}"
                )
            count = len(self.link.joined)
            self._progress(count, total)

    def _end(self) -> None:
        self.link.dismiss("the run is over")
        count = len(self.link.joined)
        while count and self.link.wait_joined(partial(_changed, count), LEAVE_WAIT_S):
            count = len(self.link.joined)


@cache
def cached_code(controller: str) -> str:
    """Return the digest of a controller's file, read once: hosts that run other code are refused."""
    try:
        return code_of(controller)
    except ControllerError:  # each node reports it
        return ""


def _changed(count: int, joined: Collection[int]) -> bool:
    return len(joined) != count
