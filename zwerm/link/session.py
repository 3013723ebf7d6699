"""What both ends of a Zenoh link share: the settings of every session, and the credential a node connects with.

Promises: no discovery (a session talks only to the endpoints it is given), no shared memory, one queue per transport so
that what is sent first arrives first. Says nothing about who may do what: that is the router's access control.
"""

import base64
import ctypes
import json
import os
import threading
from collections.abc import Mapping
from typing import Any, Final

import zenoh
from msgspec import Struct

from zwerm.errors import LinkError

# Without quality of service a transport has one queue in place of eight: declarations, queries and messages keep their
# order. With shared memory a router refuses connections past about 350 sessions.
SETTINGS: Final[Mapping[str, Any]] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/unicast/qos/enabled": False,
    # How many pieces of 64 KiB can wait to be sent: with the least, 2, a longer message would wait for the very thread that
    # it is sent from. Memory for them is taken only when needed.
    "transport/link/tx/queue/size/data": 16,
}

UNIX_PROTOCOL: Final = "unixsock-stream"

# Between processes of one machine the kernel reports a death at once, so the lease only decides how long a stopped
# process (SIGSTOP, a debugger) still counts as there. Over a network it decides how soon a cut cable is noticed.
LEASE_LOCAL_MS: Final = 600_000
LEASE_REMOTE_MS: Final = 10_000

# Zenoh's threads, which it reads from the environment once per process. What a message costs is mostly the switches
# from one thread to the next, so there are as few as can be: one that receives, answers and sends. Only where a slow
# answer must not silence the lease, and in the world, does another one send.
ONE_THREAD: Final = "(app:(worker_threads:1),acc:(handover:app),tx:(handover:app),rx:(handover:app),net:(handover:app))"
TWO_THREADS: Final = (
    "(app:(worker_threads:1),acc:(handover:app),tx:(handover:app),rx:(worker_threads:1),net:(handover:app))"
)
_THREADS_VARIABLE: Final = "ZENOH_RUNTIME"


class Credential(Struct, frozen=True, forbid_unknown_fields=True):
    """What one node connects and joins with. The router admits `user` only from the session with the Zenoh id `zid`."""

    node: int
    incarnation: int
    user: str
    password: str
    zid: str


class Credentials(Struct, frozen=True, forbid_unknown_fields=True):
    """The credentials of some nodes of a run. For TLS and QUIC, `authority_pem` signed the world's certificate."""

    run: str
    nodes: tuple[Credential, ...]
    authority_pem: str = ""


def is_local(endpoint: str) -> bool:
    """Tell whether `endpoint` can only be reached from this machine's own file system."""
    return endpoint.startswith(UNIX_PROTOCOL)


def set_threads(threads: str) -> None:
    """Choose Zenoh's threads in this process; without effect once it has opened a session."""
    os.environ[_THREADS_VARIABLE] = threads


def transport_settings(endpoints: list[str]) -> dict[str, Any]:
    """Return how long a silent transport to or from `endpoints` lives."""
    local = all(is_local(endpoint) for endpoint in endpoints)
    return {"transport/link/tx/lease": LEASE_LOCAL_MS if local else LEASE_REMOTE_MS}


def trust_settings(authority_pem: str) -> dict[str, Any]:
    """Return the settings of a node that trusts certificates signed by `authority_pem`, if there is one."""
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


_kept = threading.local()


def keep_thread() -> None:
    """Have Python keep its state of the calling thread, one of Zenoh's, from one callback to the next.

    For a thread that is not its own Python makes a state when a callback begins and throws it away when it returns, the stack
    included, which is taken from the kernel anew: together a tenth of what a message costs a robot (measured).
    """
    if not hasattr(_kept, "yes"):  # asked of that very state: the number of a thread may be another's next
        _kept.yes = True
        ctypes.pythonapi.PyGILState_Ensure()  # once more than Zenoh will release
