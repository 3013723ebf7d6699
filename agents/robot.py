"""The robot process: one asyncio loop, one Zenoh session, one Node.

Promises: it answers each observation with one command, in order; it ends by itself when the world says goodbye, when the
connection to the world is lost, when its controller fails, on SIGTERM, and with the process that started it. It ignores
SIGINT: Ctrl-C is for whoever started it. It reads no clock that a controller could see and opens no socket besides its own.
"""

import asyncio
import contextlib
import ctypes
import os
import signal
import sys
from collections.abc import Callable
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from typing import Final

import msgspec

from zwerm.agents.contract import Setup
from zwerm.agents.node import Node
from zwerm.errors import ControllerError, ZwermError
from zwerm.link.session import Credential
from zwerm.link.zenoh_node import ZenohNodeLink
from zwerm.protocol import REFUSABLE, Failure, Goodbye, Welcome, decode_to_node, encode

try:
    from uvloop import new_event_loop
except ImportError:  # not on Windows
    new_event_loop = asyncio.new_event_loop

EXIT_FAILED: Final = 1
EXIT_REFUSED: Final = 2
EXIT_LOST: Final = 3

# One thread for all of Zenoh: a robot needs no more, and the fewer the threads, the fewer the switches between them.
ZENOH_THREADS: Final = (
    "(app:(worker_threads:1),acc:(handover:app),tx:(handover:app),rx:(handover:app),net:(handover:app))"
)

_PR_SET_PDEATHSIG: Final = 1


def main(
    run: str, credential: Credential, endpoint: str, authority_pem: str, deadline_s: float, joined: Connection
) -> None:
    """Live one robot's life and exit: 0 at its end, 1 controller failed, 2 could not join, 3 lost the world."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent()
    os.environ.setdefault("ZENOH_RUNTIME", ZENOH_THREADS)
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        with asyncio.Runner(loop_factory=new_event_loop) as runner:
            code = runner.run(live(run, credential, endpoint, authority_pem, deadline_s, joined))
    except ZwermError as error:
        sys.stderr.write(f"zwerm: {error}\n")
        code = EXIT_REFUSED
    sys.exit(code)


async def live(
    run: str,
    credential: Credential,
    endpoint: str,
    authority_pem: str = "",
    deadline_s: float = 30.0,
    joined: Connection | None = None,
) -> int:
    """Join the run, answer until the end, and return the exit code.

    `joined`, if given, is sent the node's id once it has joined. Raises ZwermError where it cannot join.
    """
    loop = asyncio.get_running_loop()
    end: asyncio.Future[int] = loop.create_future()

    def finish(code: int) -> None:
        if not end.done():
            end.set_result(code)

    def from_any_thread(callback: Callable[..., None], argument: object) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended already
            loop.call_soon_threadsafe(callback, argument)

    def receive(payload: bytes) -> None:
        if end.done():
            return
        try:
            answer = node.answer(payload)
        except REFUSABLE:
            finish(0 if _is_goodbye(payload) else EXIT_LOST)
            return
        send(answer)
        if node.failed:
            finish(EXIT_FAILED)

    link = ZenohNodeLink(
        run,
        credential,
        endpoint,
        authority_pem=authority_pem,
        deadline_s=deadline_s,
        on_message=lambda payload: from_any_thread(receive, payload),
        on_lost=lambda: from_any_thread(finish, EXIT_LOST),
    )
    try:
        send = link.send
        node = _node(link, link.join())
        if joined is not None:
            with joined:
                joined.send_bytes(str(credential.node).encode())
        loop.add_signal_handler(signal.SIGTERM, finish, 0)
        parent = parent_process()
        if parent is not None:
            loop.add_reader(parent.sentinel, finish, EXIT_LOST)
        return await end
    finally:
        link.close()


def _node(link: ZenohNodeLink, welcome: Welcome) -> Node:
    """Make the node that the world describes; if that fails the world hears why."""
    setup = msgspec.msgpack.decode(welcome.setup, type=Setup)
    try:
        return Node(welcome.controller, setup)
    except ControllerError as error:
        link.send(encode(Failure(0, str(error), "")))
        raise


def _is_goodbye(payload: bytes) -> bool:
    try:
        return isinstance(decode_to_node(payload), Goodbye)
    except REFUSABLE:
        return False


def die_with_parent() -> None:
    """Have the kernel kill this process when its parent dies, where the kernel can (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
