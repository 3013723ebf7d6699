"""Network namespaces of a run's own: one for each node, joined by veth pairs to a bridge in one more.

Promises: nothing outlives this process, however it ends. A namespace has no name and no file: it is there as long as this
process holds its descriptor, or another process stands in it, and with it go its interfaces, addresses and rules. Nothing
is changed in the namespace that this process itself is in, and every address exists only inside.
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

# Inside namespaces only: addresses that were set aside for measuring networks, RFC 2544.
_FIRST: Final = IPv4Address("198.18.0.1")
_PREFIX_BITS: Final = 15

_NEW_NETWORK: Final = 0x40000000  # CLONE_NEWNET


def address_of(node: int) -> str:
    """Return a node's address."""
    return str(_FIRST + node)


def port_of(node: int) -> str:
    """Return the name of the bridge's end of a node's cable; the node's own end is `eth0`."""
    return f"node{node}"


class Namespaces:
    """The namespaces of `nodes`, and of the bridge between them, from enter to exit."""

    def __init__(self, nodes: Sequence[int]) -> None:
        self._nodes = list(nodes)
        self._stack = contextlib.ExitStack()
        self._node: dict[int, int] = {}  # descriptors

    def __enter__(self) -> Self:
        """Make everything. Raises LinkError where the kernel or a tool refuses."""
        try:
            self._bridge = self._made()
            self._node = {node: self._made() for node in self._nodes}
            cables = [
                line
                for node in self._nodes
                for line in (
                    # Packets are to be lost one by one: none that is put together from several crosses the bridge.
                    f"link add {port_of(node)} gso_max_segs 1 type veth peer name eth0 netns {self.path(node)}",
                    f"link set {port_of(node)} master bridge up",
                )
            ]
            self.run(
                ["ip", "-batch", "-"], "\n".join(["link add bridge type bridge", "link set bridge up", *cables, ""])
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
        """Let go of the namespaces: the kernel removes each when nobody is in it any more. Idempotent."""
        self._stack.close()

    def path(self, node: int | None = None) -> str:
        """Return where other processes find the namespace of a node, or of the bridge."""
        descriptor = self._bridge if node is None else self._node[node]
        return f"/proc/{os.getpid()}/fd/{descriptor}"

    def run(self, command: Sequence[str], text: str = "", node: int | None = None) -> str:
        """Run a command in the namespace of a node, or of the bridge, with `text` to read; return what it says.

        Raises LinkError with what it complains of.
        """
        done = subprocess.run(
            ["nsenter", f"--net={self.path(node)}", *command], input=text, text=True, capture_output=True, check=False
        )
        if done.returncode:
            complaint = (done.stderr or done.stdout).strip().splitlines() or [f"exit status {done.returncode}"]
            raise LinkError(f"{' '.join(command)}: {complaint[0]}")
        return done.stdout

    def _made(self) -> int:
        """Make a namespace, and return a descriptor that keeps it."""
        descriptors: list[int] = []
        errors: list[int] = []

        def make() -> None:
            # A thread of its own moves into the namespace that it makes, and ends there.
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


def missing() -> str:
    """Return in one line why this machine cannot be given networks of a run's own, or an empty string."""
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


def lacks_netem() -> str:
    """Return in one line why there is no `tc netem` here, or an empty string."""
    try:
        with Namespaces([0]) as networks:
            networks.run(["tc", "qdisc", "add", "dev", port_of(0), "root", "netem", "delay", "1ms"])
    except LinkError as error:
        return f"this kernel has no netem ({error})"
    return ""
