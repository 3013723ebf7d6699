"""Settings of every Zenoh session, and the credential of a node.

Sessions use no discovery: they connect only to the given endpoints. They use no shared memory, and one queue per transport,
so that messages arrive in the order sent. The router's access control, not this module, limits what a node may do.
"""

import base64
import contextlib
import ctypes
import json
import os
import socket
import stat
import threading
from collections.abc import Mapping
from pathlib import Path
from struct import Struct as Layout
from typing import Any, Final

import zenoh
from msgspec import Struct

from zwerm.errors import LinkError

# Without quality of service a transport has one queue instead of eight: declarations, queries and messages keep their
# order. With shared memory a router refuses connections after about 350 sessions.
SETTINGS: Final[Mapping[str, Any]] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    # A router waits this long for what it discovers before its session is open: 500 ms, for nothing.
    "scouting/delay": 0,
    "transport/shared_memory/enabled": False,
    "transport/unicast/qos/enabled": False,
    # Batches of 64 KiB that can wait to be sent. With the minimum, 2, a long message blocks on the thread that sends it.
    # Zenoh allocates them only when needed, and keeps them.
    "transport/link/tx/queue/size/data": 16,
}

UNIX_PROTOCOL: Final = "unixsock-stream"

# On one machine the kernel reports the end of a process at once. So the lease only limits how long a stopped process
# (SIGSTOP, a debugger) counts as connected. Over a network it is the time until a broken connection is detected.
LEASE_LOCAL_MS: Final = 600_000
LEASE_REMOTE_S: Final = 10.0

# Zenoh's threads, read from the environment once per process. Most of a message's cost is switches between threads, so
# there are as few as possible: one thread receives, answers and sends. A second thread sends in the world, and in nodes
# whose slow answers must not delay the lease messages.
ONE_THREAD: Final = "(app:(worker_threads:1),acc:(handover:app),tx:(handover:app),rx:(handover:app),net:(handover:app))"
TWO_THREADS: Final = (
    "(app:(worker_threads:1),acc:(handover:app),tx:(handover:app),rx:(worker_threads:1),net:(handover:app))"
)
_THREADS_VARIABLE: Final = "ZENOH_RUNTIME"


class Credential(Struct, frozen=True, forbid_unknown_fields=True):
    """Credential of one node. The router admits `user` only from the session with the Zenoh id `zid`.

    For TLS and QUIC with certificates on both sides it holds the node's own certificate, whose common name is `user`, and its
    private key, as PEM texts.
    """

    node: int
    incarnation: int
    user: str
    password: str
    zid: str
    certificate_pem: str = ""
    key_pem: str = ""


class Credentials(Struct, frozen=True, forbid_unknown_fields=True):
    """Credentials of some nodes of a run, and the terms of their connection: the fields of `Terms`."""

    run: str
    nodes: tuple[Credential, ...]
    authority_pem: str = ""
    lease_s: float = LEASE_REMOTE_S

    @property
    def terms(self) -> "Terms":
        """The terms on which every node connects."""
        return Terms(self.authority_pem, self.lease_s)


class Terms(Struct, frozen=True):
    """The authority that signs the world's certificate (PEM), and how long a connection over a network may be silent."""

    authority_pem: str = ""
    lease_s: float = LEASE_REMOTE_S


TERMS: Final = Terms()


def is_local(endpoint: str) -> bool:
    """Return whether `endpoint` is reachable only through this machine's file system."""
    return endpoint.startswith(UNIX_PROTOCOL)


def set_threads(threads: str) -> None:
    """Set Zenoh's threads in this process; no effect after its first session is open."""
    os.environ[_THREADS_VARIABLE] = threads


def transport_settings(endpoints: list[str], lease_s: float = LEASE_REMOTE_S) -> dict[str, Any]:
    """Return the lease of a silent transport to or from `endpoints`."""
    local = all(is_local(endpoint) for endpoint in endpoints)
    return {"transport/link/tx/lease": LEASE_LOCAL_MS if local else round(1000 * lease_s)}


def trust_settings(credential: Credential, terms: Terms) -> dict[str, Any]:
    """Return the settings of a node that connects by TLS or QUIC on these terms; {} without an authority."""
    if not terms.authority_pem:
        return {}
    tls: dict[str, Any] = {
        "root_ca_certificate_base64": pem_base64(terms.authority_pem),
        "verify_name_on_connect": True,
    }
    if credential.certificate_pem:
        tls |= {
            "enable_mtls": True,
            "connect_certificate_base64": pem_base64(credential.certificate_pem),
            "connect_private_key_base64": pem_base64(credential.key_pem),
        }
    return {f"transport/link/tls/{name}": value for name, value in tls.items()}


def pem_base64(pem: str) -> str:
    """Return a PEM text as Zenoh's configuration takes it, so that no file is needed."""
    return base64.b64encode(pem.encode()).decode()


def open_session(settings: Mapping[str, Any], purpose: str) -> zenoh.Session:
    """Open a session with `settings` (paths into Zenoh's configuration) on top of SETTINGS.

    Raises LinkError, whose text begins with `purpose`, if Zenoh cannot open it.
    """
    config = zenoh.Config()
    try:
        for path, value in {**SETTINGS, **settings}.items():
            config.insert_json5(path, json.dumps(value))
        return zenoh.open(config)
    except zenoh.ZError as error:
        reason = str(error).partition(" at /")[0]
        raise LinkError(f"{purpose}: {reason}") from None


def close_without_waiting() -> None:
    """Let the TCP connections that Zenoh has opened so far close at once.

    Zenoh sets SO_LINGER to 10 s. Closing a connection whose other end is gone then blocks one of its few threads for 10 s,
    and so delays the detection of each further loss by 10 s. There is no setting for it in Zenoh.
    """
    for path in list(Path("/dev/fd").iterdir()):
        with contextlib.suppress(OSError):  # the descriptor of the listing is closed; another thread may close one
            number = int(path.name)
            if not stat.S_ISSOCK(os.fstat(number).st_mode):
                continue
            with socket.socket(fileno=os.dup(number)) as connection:
                if connection.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER.size) == _ZENOH_LINGER:
                    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _NO_LINGER)


_LINGER: Final = Layout("ii")
_ZENOH_LINGER: Final = _LINGER.pack(1, 10)
_NO_LINGER: Final = _LINGER.pack(0, 0)

_kept = threading.local()


def keep_thread() -> None:
    """Make Python keep its state of the calling thread, a thread of Zenoh, between callbacks.

    For a thread that Python did not start, it makes a thread state at each callback and deletes it afterwards, including
    memory from the kernel. This takes a tenth of a robot's time per message (measured).
    """
    if not hasattr(_kept, "yes"):  # thread-local: a thread number can be reused
        _kept.yes = True
        ctypes.pythonapi.PyGILState_Ensure()  # one more reference than Zenoh releases
