"""The robot process: an asyncio loop that lives its life, one Zenoh session, one Node.

Promises: it answers each observation with one command, in order; it ends by itself when the world says goodbye or is
lost, on SIGTERM, and with the process that started it. When its controller fails it ends once the world has confirmed the
failure: the world never sees its end before the reason. It ignores SIGINT: Ctrl-C is for
whoever started it.

The loop joins, waits and ends; an observation is answered right where Zenoh delivers it. Handing each one over to the loop's
thread would cost more than everything else together (measured, a robot tick: 160 us of processor time in place of 106).
In real time it is handed over all the same: there a slow controller meets a backlog, and whoever answers a backlog in the
thread that sends can wait for itself.
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
from pathlib import Path
from typing import Any, Final

import msgspec
import uvloop

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.runtime.node import Node
from zwerm.errors import ControllerError, ZwermError
from zwerm.link.node import ZenohNodeLink
from zwerm.link.peer_radio import PeerRadio, Station, enter_namespace
from zwerm.link.session import ONE_THREAD, TWO_THREADS, Credential, is_local, set_threads
from zwerm.wire.messages import REFUSABLE, Failure, Goodbye, Welcome, decode_to_node, encode

EXIT_FAILED: Final = 1
EXIT_REFUSED: Final = 2
EXIT_LOST: Final = 3

# All robots wait for the world, so it goes first where there are more processes than cores (measured: 100 robots on two cores
# make a few per cent more ticks). Less than the most, which would leave robots next to nothing beside other work.
NICENESS: Final = 5

_PR_SET_PDEATHSIG: Final = 1


def main(
    run: str,
    credential: Credential,
    endpoint: str,
    authority_pem: str,
    deadline_s: float,
    joined: Connection,
    station: Station | None = None,
) -> None:
    """Live one robot's life and exit: 0 at its end, 1 controller failed, 2 could not join, 3 lost the world.

    With a `station` its radio is that of a real network, which this process moves into.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    die_with_parent()
    parent = parent_process()
    if parent is not None and not parent.is_alive():  # it died before the kernel was told
        sys.exit(EXIT_LOST)
    set_threads(ONE_THREAD if is_local(endpoint) and station is None else TWO_THREADS)
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)  # where a user's own controllers are
    try:
        if station is not None:
            enter_namespace(station.namespace)
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            code = runner.run(live(run, credential, endpoint, authority_pem, deadline_s, joined, station))
    except ZwermError as error:
        sys.stderr.write(f"zwerm: {error}\n")
        code = EXIT_REFUSED
    if station is not None:
        sys.stderr.flush()
        os._exit(code)  # the radio's session would wait for goodbyes that the network loses
    sys.exit(code)


async def live(
    run: str,
    credential: Credential,
    endpoint: str,
    authority_pem: str = "",
    deadline_s: float = 30.0,
    joined: Connection | None = None,
    station: Station | None = None,
) -> int:
    """Join the run, answer until the end, and return the exit code.

    `joined`, if given, is sent the node's id once it has joined. Raises ZwermError where it cannot join.
    """
    loop = asyncio.get_running_loop()
    end: asyncio.Future[int] = loop.create_future()
    may_leave = asyncio.Event()

    def finish(code: int) -> None:
        if not end.done():
            end.set_result(code)
        if code != EXIT_FAILED:  # the world is over or lost, or SIGTERM: nobody is left to hear why
            may_leave.set()

    def finish_from_outside(code: int) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended by itself
            loop.call_soon_threadsafe(finish, code)

    def heard() -> None:
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(may_leave.set)

    async def take_leave(reason: str) -> None:
        """Return when the world has taken in all that this node has said, however long that takes, or is lost."""
        link.take_leave(reason, heard)
        await may_leave.wait()

    failed = False

    def fail() -> None:
        nonlocal failed
        failed = True

    def receive(payload: bytes) -> None:
        if failed:
            return
        try:
            send(answer(payload))
        except REFUSABLE:
            finish_from_outside(0 if _is_goodbye(payload) else EXIT_LOST)
        except BaseException:  # a thread of Zenoh's cannot be left that way
            finish_from_outside(EXIT_FAILED)
        if failed:
            finish_from_outside(EXIT_FAILED)

    def receive_in_loop(payload: bytes) -> None:
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(receive, payload)

    link = ZenohNodeLink(
        run,
        credential,
        endpoint,
        authority_pem=authority_pem,
        deadline_s=deadline_s,
        on_lost=lambda: finish_from_outside(EXIT_LOST),
    )
    radio = None
    try:
        send = link.send
        radio = None if station is None else PeerRadio(run, station)
        welcome = link.join()
        loop.add_signal_handler(signal.SIGTERM, finish, 0)
        try:
            answer = _node(welcome, radio, fail).answer
        except ControllerError as error:
            link.send(encode(Failure(0, str(error), "")))
            await take_leave("it has no controller")
            raise
        parent: Any = parent_process()
        if parent is not None:
            # Where the kernel does not do it. At once, because a controller that does not return would hold up the
            # rest.
            loop.add_reader(parent.sentinel, os._exit, EXIT_LOST)
        if joined is not None:
            with contextlib.suppress(OSError), joined:  # nobody waits for it any more
                joined.send_bytes(str(credential.node).encode())
        link.listen(receive_in_loop if welcome.paced else receive)
        code = await end
        if code == EXIT_FAILED:
            await take_leave("its controller failed")
        return code
    finally:
        link.close()
        if radio is not None:
            radio.close()


def _node(welcome: Welcome, radio: PeerRadio | None, on_failure: Callable[[], object]) -> Node:
    """Make the node that the world describes. Raises ControllerError where it has no such controller."""
    node = Node(welcome.controller, msgspec.msgpack.decode(welcome.setup, type=Setup), on_failure)
    if radio is not None:
        node.go_on_air(radio)
    return node


def _is_goodbye(payload: bytes) -> bool:
    try:
        return isinstance(decode_to_node(payload), Goodbye)
    except REFUSABLE:
        return False


def die_with_parent() -> None:
    """Have the kernel kill this process when its parent dies, where the kernel can do that (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
