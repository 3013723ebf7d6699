"""Network namespaces of a run: one for each node, connected by veth pairs to a bridge in one more namespace.

No namespace outlives this process. It has no name and no file. When no process holds its descriptor or runs in it, the
kernel removes it, with its interfaces, addresses and rules. The namespace of this process itself is never changed.
"""

import contextlib
import ctypes
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Sequence
from ipaddress import IPv4Address
from typing import Final, Self

from zwerm.errors import LinkError

TOOLS: Final = {"ip": "iproute2", "tc": "iproute2", "nft": "nftables", "nsenter": "util-linux"}

# Addresses reserved for network benchmarks (RFC 2544); they exist inside the namespaces only.
_FIRST: Final = IPv4Address("198.18.0.1")
_PREFIX_BITS: Final = 15

_NEW_NETWORK: Final = 0x40000000  # CLONE_NEWNET


def address_of(node: int) -> str:
    """Return a node's address."""
    return str(_FIRST + node)


def port_of(node: int) -> str:
    """Return the name of the bridge's end of a node's veth pair; the node's own end is `eth0`."""
    return f"node{node}"


class Namespaces:
    """The namespaces of `nodes` and of the bridge between them, from enter to exit."""

    def __init__(self, nodes: Sequence[int]) -> None:
        self._nodes = list(nodes)
        self._stack = contextlib.ExitStack()
        self._node: dict[int, int] = {}  # descriptors

    def __enter__(self) -> Self:
        """Create all namespaces and interfaces. Raises LinkError if the kernel or a tool refuses."""
        try:
            self._bridge = self._make_namespace()
            self._node = {node: self._make_namespace() for node in self._nodes}
            interfaces = [
                line
                for node in self._nodes
                for line in (
                    # Packets are lost one by one, so segmentation offload is off: no frame holds several packets.
                    f"link add {port_of(node)} gso_max_segs 1 type veth peer name eth0 netns {self.path(node)}",
                    f"link set {port_of(node)} master bridge up",
                )
            ]
            self.run(
                ["ip", "-batch", "-"], "\n".join(["link add bridge type bridge", "link set bridge up", *interfaces, ""])
            )
            for node in self._nodes:
                commands = (
                    "link set lo up",
                    f"addr add {address_of(node)}/{_PREFIX_BITS} dev eth0",
                    "link set eth0 gso_max_segs 1 up",
                )
                self.run(["ip", "-batch", "-"], "\n".join([*commands, ""]), node)
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the descriptors. The kernel removes each namespace when its last process leaves. Idempotent."""
        self._stack.close()

    def path(self, node: int | None = None) -> str:
        """Return the path of the namespace of a node, or of the bridge, for other processes."""
        descriptor = self._bridge if node is None else self._node[node]
        return f"/proc/{os.getpid()}/fd/{descriptor}"

    def run(self, command: Sequence[str], text: str = "", node: int | None = None) -> str:
        """Run a command in the namespace of a node, or of the bridge, with `text` as its input; return its output.

        Raises LinkError with the first line of its error output if it fails.
        """
        done = subprocess.run(
            ["nsenter", f"--net={self.path(node)}", *command], input=text, text=True, capture_output=True, check=False
        )
        if done.returncode:
            complaint = (done.stderr or done.stdout).strip().splitlines() or [f"exit status {done.returncode}"]
            raise LinkError(f"{' '.join(command)}: {complaint[0]}")
        return done.stdout

    def _make_namespace(self) -> int:
        """Create a namespace, and return a descriptor that keeps it alive."""
        descriptors: list[int] = []
        errors: list[int] = []

        def make() -> None:
            # unshare moves the calling thread, so a new thread calls it and ends.
            if ctypes.CDLL(None, use_errno=True).unshare(_NEW_NETWORK):
                errors.append(ctypes.get_errno())
            else:
                descriptors.append(os.open("/proc/thread-self/ns/net", os.O_RDONLY | os.O_CLOEXEC))

        thread = threading.Thread(target=make, name="zwerm-namespace")
        thread.start()
        thread.join()
        if errors:
            raise LinkError(f"cannot make a network namespace: {os.strerror(errors[0])}")
        self._stack.callback(os.close, descriptors[0])
        return descriptors[0]


def unavailable_reason() -> str:
    """Return in one line why network namespaces cannot be used on this machine, or an empty string."""
    if sys.platform != "linux":
        return f"needs Linux, this is {sys.platform}"
    if os.geteuid() != 0:
        return "needs root, to make network namespaces"
    for tool, package in TOOLS.items():
        if shutil.which(tool) is None:
            return f"needs the command {tool}, from the package {package}"
    probe = (
        "table bridge probe {\n chain c {\n type filter hook forward priority 0; numgen random mod 2 < 1 drop\n }\n}\n"
    )
    try:
        with Namespaces([0]) as networks:
            networks.run(["nft", "-f", "-"], probe)
    except LinkError as error:
        return f"needs a kernel and rights for it: {error}"
    return ""


def netem_unavailable_reason() -> str:
    """Return in one line why `tc netem` cannot be used on this machine, or an empty string."""
    try:
        with Namespaces([0]) as networks:
            networks.run(["tc", "qdisc", "add", "dev", port_of(0), "root", "netem", "delay", "1ms"])
    except LinkError as error:
        return f"this kernel has no netem ({error})"
    return ""
