"""Zenoh endpoints of a run over a network: whether they are encrypted, and whether they are reachable from other machines."""

from collections.abc import Iterable
from ipaddress import ip_address
from typing import Final

from zwerm.errors import LinkError
from zwerm.link.session import is_local

_ENCRYPTED: Final = ("tls/", "quic/")


def is_encrypted(endpoint: str) -> bool:
    """Return whether everything that crosses an endpoint is encrypted."""
    return endpoint.startswith(_ENCRYPTED)


def host_of(endpoint: str) -> str:
    """Return the host name or address of an endpoint such as `tls/localhost:7447` or `tcp/[::1]:7447`."""
    return endpoint.partition("/")[2].rpartition(":")[0].strip("[]")


def is_loopback(endpoint: str) -> bool:
    """Return whether an endpoint is reachable from this machine only."""
    if is_local(endpoint):
        return True
    host = host_of(endpoint)
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def check_encryption(endpoints: Iterable[str]) -> None:
    """Raise LinkError for an endpoint without encryption that other machines can reach."""
    for endpoint in endpoints:
        if not is_encrypted(endpoint) and not is_loopback(endpoint):
            raise LinkError(
                f"{endpoint}: expected tls/ or quic/ beyond this machine, because {endpoint.partition('/')[0]} encrypts "
                "nothing; --plain allows it in a network that you trust"
            )
