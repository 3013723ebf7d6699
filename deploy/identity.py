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
from typing import Any, Final

import msgspec

from zwerm.errors import LinkError
from zwerm.link.session import Credential, Credentials, transport_settings
from zwerm.wire.keys import EVERY, alive_key, command_key, hello_key, observation_key
from zwerm.wire.messages import MESSAGE_BYTES_MAX

PRIVATE_FILE_MODE: Final = 0o600
SECRET_BYTES: Final = 24

# The router discards a longer message. The receiver refuses and counts messages between MESSAGE_BYTES_MAX and this size.
_MESSAGE_BYTES_MAX: Final = 16 * MESSAGE_BYTES_MAX

# Operations allowed to a node on its keys: (key, message, flow seen from the router).
_PERMISSIONS: Final = (
    (command_key, "put", "ingress"),
    (observation_key, "declare_subscriber", "ingress"),
    (observation_key, "put", "egress"),
    (hello_key, "query", "ingress"),
    (hello_key, "reply", "egress"),
    (alive_key, "liveliness_token", "ingress"),
)


def issue(run: str, nodes: Iterable[int], authority_pem: str = "") -> Credentials:
    """Return new random credentials for `nodes`. The nodes trust certificates signed by `authority_pem`."""
    return Credentials(run, tuple(_issue(node) for node in nodes), authority_pem)


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


def router_settings(credentials: Credentials, endpoints: list[str], dictionary: Path) -> dict[str, Any]:
    """Return the Zenoh settings of a router that listens on `endpoints` and admits these credentials only.

    Writes the passwords to the file `dictionary`. The router reads it when its session opens; the caller then removes it.
    """
    write_private(dictionary, "".join(f"{node.user}:{node.password}\n" for node in credentials.nodes).encode())
    capacity = len(credentials.nodes)
    return {
        "listen/endpoints": endpoints,
        "listen/exit_on_failure": True,
        "transport/unicast/accept_pending": 2 * capacity + 100,
        "transport/unicast/max_sessions": 2 * capacity + 100,
        "transport/auth/usrpwd/dictionary_file": str(dictionary),
        "transport/link/rx/max_message_size": _MESSAGE_BYTES_MAX,
        "access_control": access_control(credentials),
        **transport_settings(endpoints),
    }


def access_control(credentials: Credentials) -> dict[str, Any]:
    """Return the access control that allows each node its own keys and nothing else."""
    # A session publishes only if it knows of a subscriber, so each node may see the world's subscription.
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
    subjects = [{"id": node.user, "usernames": [node.user], "zids": [node.zid]} for node in credentials.nodes]
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
    return Credentials(credentials.run, tuple(known[node] for node in chosen), credentials.authority_pem)


def save(credentials: Credentials, path: Path) -> None:
    """Write credentials to a file that only its owner can read. Raises LinkError if the file cannot be written."""
    try:
        write_private(path, msgspec.json.format(msgspec.json.encode(credentials), indent=1))
    except OSError as error:
        raise LinkError(f"{path}: cannot write credentials: {error.strerror}") from None


def load(path: Path) -> Credentials:
    """Return the credentials in a file. Raises LinkError if it is missing, readable by others, or malformed."""
    try:
        if path.stat().st_mode & 0o077:
            raise LinkError(f"{path}: credentials must be readable by their owner only (chmod 600)")
        return msgspec.json.decode(path.read_bytes(), type=Credentials)
    except OSError as error:
        raise LinkError(f"{path}: cannot read credentials: {error.strerror}") from None
    except msgspec.DecodeError as error:
        raise LinkError(f"{path}: no credentials: {error}") from None


def write_private(path: Path, content: bytes) -> None:
    """Write a new file that only its owner can read, from its first byte on. Raises OSError if `path` exists."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, PRIVATE_FILE_MODE)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
