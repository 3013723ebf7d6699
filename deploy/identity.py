"""Credentials of a run's nodes, and the access control of its router.

Each run has new random credentials. The router admits a user name only with its password, and only from the session with
the Zenoh id of the same credential. Access control denies by default. It allows each node four things on its own keys: put
commands, receive observations, send hello, and hold its liveliness token. The router enforces locality, not the node.

Processes on this machine get credentials through a pipe, other machines through a file (mode 0600). Credentials never
appear on a command line or in the environment.
"""

import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec
from msgspec import Struct

from zwerm.errors import LinkError
from zwerm.link.session import LEASE_REMOTE_S, Credential, Credentials, pem_base64, transport_settings
from zwerm.wire.keys import EVERY, alive_key, command_key, hello_key, observation_key
from zwerm.wire.messages import MESSAGE_BYTES_MAX

T = TypeVar("T")

PRIVATE_FILE_MODE: Final = 0o600
SECRET_BYTES: Final = 24
PROBE: Final = "probe"
PENDING_MAX: Final = 4_000
ACCEPT_TIMEOUT_MS: Final = 5_000

# The router discards a longer message. The receiver refuses and counts messages between MESSAGE_BYTES_MAX and this size.
_MESSAGE_BYTES_MAX: Final = 16 * MESSAGE_BYTES_MAX

# Batches of 64 KiB that can wait to be sent to a node: a world that is delayed fills all of them, for every node, and the
# middleware keeps them. A thread of its own sends them, so that a long message waits only for that.
_BATCHES: Final = 2

# Operations allowed to a node on its keys: (key, message, flow seen from the router).
_PERMISSIONS: Final = (
    (command_key, "put", "ingress"),
    (observation_key, "declare_subscriber", "ingress"),
    (observation_key, "put", "egress"),
    (hello_key, "query", "ingress"),
    (hello_key, "reply", "egress"),
    (alive_key, "liveliness_token", "ingress"),
)


class WorldIdentity(Struct, frozen=True, forbid_unknown_fields=True):
    """The world's end of a TLS or QUIC connection, as PEM texts. With `mutual` the nodes must have certificates too."""

    certificate_pem: str
    key_pem: str
    authority_pem: str
    mutual: bool = True


class WorldKeys(Struct, frozen=True, forbid_unknown_fields=True):
    """The keys of a world that were made before it starts: its identity, and its nodes' passwords."""

    identity: WorldIdentity
    credentials: Credentials


def issue(run: str, nodes: Iterable[int], authority_pem: str = "", lease_s: float = LEASE_REMOTE_S) -> Credentials:
    """Return new random credentials for `nodes`. The nodes trust certificates signed by `authority_pem`."""
    return Credentials(run, tuple(_issue(node) for node in nodes), authority_pem, lease_s)


def renew(credential: Credential) -> Credential:
    """Return the credential for a restarted node: the same connection, the next incarnation number."""
    return msgspec.structs.replace(credential, incarnation=credential.incarnation + 1)


def _issue(node: int) -> Credential:
    return Credential(
        node=node,
        incarnation=1,
        user=f"node-{node}",
        password=secrets.token_urlsafe(SECRET_BYTES),
        zid="f" + secrets.token_hex(15),
    )


def router_settings(
    credentials: Credentials,
    endpoints: list[str],
    dictionary: Path,
    identity: WorldIdentity | None = None,
    probe_password: str = "",
) -> dict[str, Any]:
    """Return the Zenoh settings of a router that listens on `endpoints` and admits these credentials only.

    With `probe_password` it also admits the user PROBE, who may do nothing: to see whether it takes sessions. Writes the
    passwords to the file `dictionary`. The router reads it when its session opens; the caller then removes it.
    """
    users = {node.user: node.password for node in credentials.nodes} | (
        {PROBE: probe_password} if probe_password else {}
    )
    write_private(dictionary, "".join(f"{user}:{password}\n" for user, password in users.items()).encode())
    capacity = len(credentials.nodes)
    return {
        "listen/endpoints": endpoints,
        "listen/exit_on_failure": True,
        # Silent connections must not prevent nodes from joining: many may wait, each for a short time.
        "transport/unicast/accept_pending": 2 * capacity + PENDING_MAX,
        "transport/unicast/accept_timeout": ACCEPT_TIMEOUT_MS,
        "transport/unicast/max_sessions": 2 * capacity + 100,
        "transport/auth/usrpwd/dictionary_file": str(dictionary),
        "transport/link/rx/max_message_size": _MESSAGE_BYTES_MAX,
        "transport/link/tx/queue/size/data": _BATCHES,
        "access_control": access_control(credentials, identity is not None and identity.mutual),
        **transport_settings(endpoints, credentials.lease_s),
        **({} if identity is None else _tls_settings(identity)),
    }


def _tls_settings(identity: WorldIdentity) -> dict[str, Any]:
    tls = {
        "listen_certificate_base64": pem_base64(identity.certificate_pem),
        "listen_private_key_base64": pem_base64(identity.key_pem),
        "root_ca_certificate_base64": pem_base64(identity.authority_pem),
        "enable_mtls": identity.mutual,
    }
    return {f"transport/link/tls/{name}": value for name, value in tls.items()}


def access_control(credentials: Credentials, mutual: bool = False) -> dict[str, Any]:
    """Return the access control that allows each node its own keys and nothing else.

    With `mutual` TLS a node is known by user name, Zenoh id and the common name of its certificate, all three.
    """
    # A session publishes only if it has seen a subscriber, so each node may see the world's subscription.
    listens = _allow("world-listens", command_key(credentials.run, EVERY), "declare_subscriber", "egress")
    rules = [listens]
    policies = []
    for credential in credentials.nodes:
        own = [
            _allow(f"{credential.node}.{number}", key(credentials.run, credential.node), message, flow)
            for number, (key, message, flow) in enumerate(_PERMISSIONS)
        ]
        rules += own
        policies.append({"rules": [rule["id"] for rule in [listens, *own]], "subjects": [credential.user]})
    subjects = [
        {"id": node.user, "usernames": [node.user], "zids": [node.zid]}
        | ({"cert_common_names": [node.user]} if mutual else {})
        for node in credentials.nodes
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _allow(name: str, key: str, message: str, flow: str) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "messages": [message], "flows": [flow], "key_exprs": [key]}


def slice_of(credentials: Credentials, nodes: Iterable[int]) -> Credentials:
    """Return the credentials of `nodes` only. Raises LinkError if one of them has none."""
    known = {credential.node: credential for credential in credentials.nodes}
    chosen = list(nodes)
    if unknown := [node for node in chosen if node not in known]:
        raise LinkError(f"the credentials hold no node {unknown[0]}")
    return msgspec.structs.replace(credentials, nodes=tuple(known[node] for node in chosen))


def save(credentials: Credentials | WorldKeys, path: Path) -> None:
    """Write credentials to a new file that only its owner can read. Raises LinkError if the file cannot be written."""
    try:
        write_private(path, msgspec.json.format(msgspec.json.encode(credentials), indent=1))
    except OSError as error:
        raise LinkError(f"{path}: cannot write credentials: {error.strerror}") from None


def save_world_keys(keys: WorldKeys, path: Path) -> None:
    """Write a world's keys to a new file that only its owner can read, without the nodes' private keys. Raises LinkError."""
    nodes = tuple(msgspec.structs.replace(node, certificate_pem="", key_pem="") for node in keys.credentials.nodes)
    stripped = msgspec.structs.replace(keys.credentials, nodes=nodes)
    save(msgspec.structs.replace(keys, credentials=stripped), path)


def load(path: Path) -> Credentials:
    """Return the credentials in a file. Raises LinkError if it is missing, readable by others, or malformed."""
    return _load(path, Credentials)


def load_world_keys(path: Path) -> WorldKeys:
    """Return a world's keys in a file. Raises LinkError as `load` does."""
    return _load(path, WorldKeys)


def _load(path: Path, kind: type[T]) -> T:
    try:
        if path.stat().st_mode & 0o077:
            raise LinkError(f"{path}: credentials must be readable by their owner only (chmod 600)")
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except OSError as error:
        raise LinkError(f"{path}: cannot read credentials: {error.strerror}") from None
    except msgspec.DecodeError as error:
        raise LinkError(f"{path}: no credentials: {error}") from None


def write_private(path: Path, content: bytes) -> None:
    """Write a new file that only its owner can read, from its first byte on. Raises OSError if `path` exists."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, PRIVATE_FILE_MODE)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
