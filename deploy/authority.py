"""Certificates of a run over a network: an authority of its own, the world's certificate, and one for each node.

Both ends are authenticated (mutual TLS). The common name of a node's certificate is its user name, and access control
binds the node's keys to it. The private key of the authority is deleted at once: no node can be added later. The tool
`openssl` makes the certificates, in a private directory.
"""

import shutil
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

import msgspec

from zwerm.deploy.identity import WorldIdentity
from zwerm.deploy.runtime_directory import private_directory
from zwerm.errors import LinkError
from zwerm.link.session import Credentials

VALID_DAYS: Final = 30
_CURVE: Final = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")


def certify(credentials: Credentials, names: Sequence[str]) -> tuple[WorldIdentity, Credentials]:
    """Return the identity of a world that is reached as `names`, and `credentials` with a certificate for each node.

    `names` are host names and IP addresses. Raises LinkError without `openssl`, or if it fails.
    """
    if shutil.which("openssl") is None:
        raise LinkError("certificates need the command openssl, from the package openssl")
    with private_directory() as directory:
        authority = _Authority(directory)
        certificate, key = authority.sign("zwerm world", names, "serverAuth")
        nodes = []
        for node in credentials.nodes:
            own, own_key = authority.sign(node.user, (), "clientAuth")
            nodes.append(msgspec.structs.replace(node, certificate_pem=own, key_pem=own_key))
        pem = authority.pem
    identity = WorldIdentity(certificate, key, pem)
    return identity, msgspec.structs.replace(credentials, nodes=tuple(nodes), authority_pem=pem)


class _Authority:
    """A certificate authority with its files in `directory`."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        _openssl(
            directory,
            *("req", "-x509", *_CURVE, "-days", str(VALID_DAYS), "-subj", "/CN=zwerm run"),
            *("-addext", "basicConstraints=critical,CA:TRUE", "-addext", "keyUsage=critical,keyCertSign"),
            *("-keyout", "authority.key", "-out", "authority.pem"),
        )
        self.pem = (directory / "authority.pem").read_text()

    def sign(self, common_name: str, names: Iterable[str], purpose: str) -> tuple[str, str]:
        """Return a new certificate and its private key."""
        alternatives = ",".join(f"IP:{each}" if _is_address(each) else f"DNS:{each}" for each in names)
        extensions = ["basicConstraints=critical,CA:FALSE", f"extendedKeyUsage={purpose}"]
        if alternatives:
            extensions.append(f"subjectAltName={alternatives}")
        (self._directory / "extensions").write_text("\n".join(extensions) + "\n")
        _openssl(
            self._directory, "req", *_CURVE, "-subj", f"/CN={common_name}", "-keyout", "own.key", "-out", "own.csr"
        )
        _openssl(
            self._directory,
            *("x509", "-req", "-in", "own.csr", "-CA", "authority.pem", "-CAkey", "authority.key", "-CAcreateserial"),
            *("-days", str(VALID_DAYS), "-extfile", "extensions", "-out", "own.pem"),
        )
        return (self._directory / "own.pem").read_text(), (self._directory / "own.key").read_text()


def _is_address(name: str) -> bool:
    return ":" in name or name.replace(".", "").isdigit()


def _openssl(directory: Path, *arguments: str) -> None:
    done = subprocess.run(["openssl", *arguments], cwd=directory, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        raise LinkError(f"openssl {arguments[0]}: {lines[-1]}")
