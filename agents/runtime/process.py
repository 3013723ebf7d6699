"""The robot process: an asyncio loop, one Zenoh session and one Node.

The process answers each observation with one command, in order. It exits when the world sends goodbye or is lost, on SIGTERM,
and with the process that started it. After a failure of its controller it exits once the world has confirmed the failure, so
the world always gets the reason first. It ignores SIGINT: the process that started it handles Ctrl-C.

The loop joins, waits and ends. Zenoh's thread answers observations where it delivers them. Passing each observation to
the loop's thread would cost more than all other work together (measured: 160 instead of 106 us of processor time a
robot and tick). In real time observations are passed to the loop nevertheless. The backlog of a slow controller collects there.
If the sending thread answered it, the backlog could block that thread.
"""

import asyncio
import contextlib
import ctypes
import io
import os
import signal
import sys
import warnings
from collections.abc import Callable
from multiprocessing import forkserver, parent_process, resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final, TextIO

import msgspec
import uvloop

from zwerm.agents.runtime.confinement import UNCONFINED, Confinement
from zwerm.agents.runtime.contract import Setup
from zwerm.agents.runtime.controllers import code_of
from zwerm.agents.runtime.fork_guard import refuse_forks
from zwerm.agents.runtime.node import Node
from zwerm.errors import ControllerError, ZwermError
from zwerm.link.node_link import ZenohNodeLink
from zwerm.link.peer_radio import PeerRadio, Station, enter_namespace
from zwerm.link.session import ONE_THREAD, TERMS, TWO_THREADS, Credential, Terms, is_local, set_threads
from zwerm.wire.messages import REFUSABLE, Failure, Goodbye, Welcome, decode_to_node, encode

EXIT_FAILED: Final = 1
EXIT_REFUSED: Final = 2
EXIT_LOST: Final = 3

# All robots wait for the world. So the world has priority if there are more processes than cores (measured: a few per
# cent more ticks with 100 robots on two cores). The largest niceness would starve robots beside other programs.
NICENESS: Final = 5

_PR_SET_PDEATHSIG: Final = 1
_PR_SET_DUMPABLE: Final = 4
_PR_SET_CHILD_SUBREAPER: Final = 36


def main(
    run: str,
    credential: Credential,
    endpoint: str,
    terms: Terms,
    deadline_s: float,
    joined: Connection,
    station: Station | None = None,
    confinement: Confinement = UNCONFINED,
) -> None:
    """Run one robot and exit: 0 end of the run, 1 the controller failed, 2 could not join, 3 lost the world.

    With a `station` the process moves into its network namespace and sends packets over that network.
    """
    die_with_parent(_server)
    _close_pipes_of_server()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The group identifies the processes that a controller has started. A session would do so, too, but Linux may schedule each
    # session as a group of its own (autogroup). Then each robot has as much time as the world, whatever its niceness.
    os.setpgid(0, 0)
    os.register_at_fork(after_in_child=die_with_parent)
    refuse_forks(anywhere=True)
    hide_memory()
    os.nice(NICENESS)
    parent = parent_process()
    if parent is not None and not parent.is_alive():  # where the kernel has no die_with_parent
        os._exit(EXIT_LOST)
    os.dup2(2, 1)  # standard output is for the results of the run
    sys.stdout = _Prefixed(sys.stderr, f"node {credential.node}: ")
    set_threads(ONE_THREAD if is_local(endpoint) and station is None else TWO_THREADS)
    sys.breakpointhook = _no_terminal
    with contextlib.suppress(FileNotFoundError):  # the folder may be deleted while the run goes on
        here = str(Path.cwd())
        if here not in sys.path:
            sys.path.append(here)  # the place of a user's own controllers
    try:
        if station is not None:
            enter_namespace(station.namespace)
        elif is_local(endpoint):
            confinement.leave_network()
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            code = runner.run(run_node(run, credential, endpoint, terms, deadline_s, joined, station, confinement))
    except ZwermError as error:
        sys.stderr.write(f"zwerm: {error}\n")
        code = EXIT_REFUSED
    if station is not None:
        sys.stderr.flush()
        os._exit(code)  # closing the radio's session waits for messages that the network loses
    sys.exit(code)


def _close_pipes_of_server() -> None:
    """Close the pipes by which a process starts others by the server of robots, and its tracker of resources.

    A robot starts none. Any byte from it would end the server, and make the tracker print a traceback.
    """
    # They have no public names.
    holders = (
        (vars(forkserver)["_forkserver"], "_forkserver_alive_fd"),
        (vars(resource_tracker)["_resource_tracker"], "_fd"),
    )
    for holder, name in holders:
        descriptor: int | None = getattr(holder, name)
        if descriptor is not None:
            os.close(descriptor)
            setattr(holder, name, None)


class _Prefixed(io.TextIOBase):
    """A text stream that writes whole lines to `stream`, each after `prefix`."""

    def __init__(self, stream: TextIO, prefix: str) -> None:
        self._stream, self._prefix, self._line = stream, prefix, ""

    def writable(self) -> bool:
        """Report that the stream can be written to."""
        return True

    def write(self, text: str) -> int:
        """Write the lines that `text` completes."""
        *whole, self._line = (self._line + text).split("\n")
        if whole:
            self._stream.write("".join(f"{self._prefix}{line}\n" for line in whole))
            self._stream.flush()
        return len(text)


def _no_terminal(*_: object, **__: object) -> None:
    raise RuntimeError("breakpoint() needs a terminal, and a robot process has none: run with --inline")


async def run_node(
    run: str,
    credential: Credential,
    endpoint: str,
    terms: Terms = TERMS,
    deadline_s: float = 30.0,
    joined: Connection | None = None,
    station: Station | None = None,
    confinement: Confinement = UNCONFINED,
) -> int:
    """Join the run, answer observations until its end, and return the exit code.

    Writes the node's password to `joined` once the node has joined. Raises ZwermError if it cannot join.
    """
    loop = asyncio.get_running_loop()
    end: asyncio.Future[int] = loop.create_future()
    may_exit = asyncio.Event()

    def finish(code: int) -> None:
        if not end.done():
            end.set_result(code)
        if code != EXIT_FAILED:  # the run is over, or the world lost, or SIGTERM: no goodbye is needed
            may_exit.set()

    def finish_from_thread(code: int) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(finish, code)

    def confirmed() -> None:
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(may_exit.set)

    async def leave(reason: str) -> None:
        """Send goodbye, and wait until the world has confirmed all messages, or is lost."""
        link.send_goodbye(reason, confirmed)
        await may_exit.wait()

    failed, own_id = False, os.getpid()

    def fail() -> None:
        nonlocal failed
        failed = True

    def receive(payload: bytes) -> None:
        if failed:
            return
        try:
            command = answer(payload)
            if os.getpid() != own_id:  # a process that the controller has forked: the connection belongs to its parent
                os._exit(EXIT_FAILED)
            send(command)
        except REFUSABLE:
            finish_from_thread(0 if _is_goodbye(payload) else EXIT_LOST)
        except BaseException:  # an exception must not leave a callback of Zenoh
            finish_from_thread(EXIT_FAILED)
        if failed:
            finish_from_thread(EXIT_FAILED)

    def receive_in_loop(payload: bytes) -> None:
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(receive, payload)

    link = ZenohNodeLink(
        run,
        credential,
        endpoint,
        terms=terms,
        deadline_s=deadline_s,
        on_lost=lambda: finish_from_thread(EXIT_LOST),
    )
    radio = None
    try:
        send = link.send
        radio = None if station is None else PeerRadio(run, station)
        welcome = link.join()
        loop.add_signal_handler(signal.SIGTERM, finish, 0)
        try:
            confinement.apply(credential.node)  # after the connection, whose socket only the world's user may open
            if confinement.first_user is not None:  # the kernel forgets the request when the user changes
                die_with_parent(_server)
            answer = _node(welcome, radio, fail).answer
        except ControllerError as error:
            link.send(encode(Failure(0, str(error), "")))
            await leave("it has no controller")
            raise
        parent: Any = parent_process()
        if parent is not None:
            # For systems without die_with_parent. Exits at once, because a controller that does not return blocks the
            # normal end.
            loop.add_reader(parent.sentinel, os._exit, EXIT_LOST)
        if joined is not None:
            with contextlib.suppress(OSError), joined:  # the supervisor does not wait any more
                os.write(joined.fileno(), credential.password.encode())
        link.listen(receive_in_loop if welcome.paced else receive)
        code = await end
        if code == EXIT_FAILED:
            await leave("its controller failed")
        return code
    finally:
        link.close()
        if radio is not None:
            radio.close()


def _node(welcome: Welcome, radio: PeerRadio | None, on_failure: Callable[[], object]) -> Node:
    """Make the node that the world describes. Raises ControllerError if the controller is not found."""
    if welcome.code and code_of(welcome.controller) != welcome.code:
        raise ControllerError(f"{welcome.controller}: its file here differs from the world's; install the same on both")
    setup = msgspec.msgpack.decode(welcome.setup, type=Setup)
    try:
        node = Node(welcome.controller, setup, on_failure, interruptible=False)
    except KeyboardInterrupt as error:  # this process ignores Ctrl-C
        raise ControllerError(f"{welcome.controller}: it raised KeyboardInterrupt while it was made") from error
    if radio is not None:
        node.use_radio(radio)
    return node


def _is_goodbye(payload: bytes) -> bool:
    try:
        return isinstance(decode_to_node(payload), Goodbye)
    except REFUSABLE:
        return False


def die_with_parent(parent: int | None = None) -> None:
    """Tell the kernel to kill this process when its parent dies (Linux only).

    Exits at once if `parent` is no longer the parent: it died before this request to the kernel, so the kernel sends no
    signal.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if parent is not None and os.getppid() != parent:
            os._exit(EXIT_LOST)


def hide_memory() -> None:
    """Close this process's memory to other processes of the same user, and write no core dump (Linux only)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_DUMPABLE, 0)


_server: int | None = None


def serve_robots() -> None:
    """Record that robots are forked from this process: a robot ends when its parent is no longer this process.

    On Linux this process also becomes the parent of what a robot that has ended had started.
    """
    global _server
    _server = os.getpid()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)
    warnings.filterwarnings("ignore", "forkserver: waitpid returned unexpected pid")
