"""What both ends of a Zenoh link share: the settings of every session, and the credential a node connects with.

Promises: no discovery (a session talks only to the endpoints it is given), no shared memory, one FIFO queue per transport
so that what is sent first arrives first. Says nothing about who may do what: that is the router's access control.
"""

import base64
import json
from collections.abc import Mapping
from typing import Any, Final

import zenoh
from msgspec import Struct

from zwerm.errors import LinkError

# Without quality of service a transport has one queue in place of eight: declarations, queries and messages keep their order.
# Shared memory makes a router refuse connections past about 350 sessions.
SETTINGS: Final[Mapping[str, Any]] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/unicast/qos/enabled": False,
}

UNIX_PROTOCOL: Final = "unixsock-stream"

# Between processes of one machine the kernel reports a death at once, so the lease only decides how long a stopped process
# (SIGSTOP, a debugger) is still a member. Over a network it also decides how soon a cut cable is noticed.
LEASE_LOCAL_MS: Final = 600_000
LEASE_REMOTE_MS: Final = 10_000


class Credential(Struct, frozen=True, forbid_unknown_fields=True):
    """What one node connects and joins with. The router admits `user` only from the session with the Zenoh id `zid`."""

    node: int
    incarnation: int
    user: str
    password: str
    zid: str


class Credentials(Struct, frozen=True, forbid_unknown_fields=True):
    """The credentials of some nodes of a run. `authority_pem` is the certificate that signs the world's, for TLS and QUIC."""

    run: str
    nodes: tuple[Credential, ...]
    authority_pem: str = ""


def lease_settings(endpoints: list[str]) -> dict[str, Any]:
    """Return how long a silent transport to `endpoints` lives."""
    local = all(endpoint.startswith(UNIX_PROTOCOL) for endpoint in endpoints)
    return {"transport/link/tx/lease": LEASE_LOCAL_MS if local else LEASE_REMOTE_MS}


def tls_settings(authority_pem: str) -> dict[str, Any]:
    """Return the settings of a node that trusts the certificates signed by `authority_pem`, if any."""
    if not authority_pem:
        return {}
    return {"transport/link/tls/root_ca_certificate_base64": base64.b64encode(authority_pem.encode()).decode()}


def open_session(settings: Mapping[str, Any], purpose: str) -> zenoh.Session:
    """Open a session with `settings` (paths into Zenoh's configuration) on top of SETTINGS.

    Raises LinkError, which begins with `purpose`, where Zenoh cannot.
    """
    config = zenoh.Config()
    try:
        for path, value in {**SETTINGS, **settings}.items():
            config.insert_json5(path, json.dumps(value))
        return zenoh.open(config)
    except zenoh.ZError as error:
        reason = str(error).partition(" at /")[0]
        raise LinkError(f"{purpose}: {reason}") from None
