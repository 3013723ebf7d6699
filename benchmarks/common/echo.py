"""Rate of a bare echo over Zenoh's Python binding: the upper limit of the emulator's lock-step rate.

The world publishes a payload to each of n robots, each robot publishes it back from Zenoh's callback, the world waits for
all, and repeats. Processes, sessions, access control and threads are the emulator's. The loop contains no other code of the
emulator: no protocol, no controller, no asyncio, no deadline.

    python -m benchmarks.common.echo 100 --ticks 200 --bytes 100
"""

import argparse
import contextlib
import multiprocessing
import os
import shutil
import signal
import tempfile
import time
from pathlib import Path

import zenoh
from zenoh.handlers import Callback, FifoChannel

from zwerm.deploy.identity import issue, router_settings
from zwerm.deploy.supervisor import JOINING_MAX, main_module_hidden, prepare
from zwerm.link.session import (
    ONE_THREAD,
    TWO_THREADS,
    UNIX_PROTOCOL,
    Credential,
    open_session,
    set_threads,
    transport_settings,
)
from zwerm.wire.keys import EVERY, command_key, observation_key

RUN = "echo"
BLOCK = zenoh.CongestionControl.BLOCK


def echo(credential: Credential, endpoint: str, niceness: int) -> None:
    """Run one robot: send one message when it is ready, then return each message."""
    os.nice(niceness)
    set_threads(ONE_THREAD)
    session = open_session(
        {
            "mode": "client",
            "id": credential.zid,
            "connect/endpoints": [endpoint],
            "transport/auth/usrpwd": {"user": credential.user, "password": credential.password},
            **transport_settings([endpoint]),
        },
        "echo",
    )
    publisher = session.declare_publisher(command_key(RUN, credential.node), express=True, congestion_control=BLOCK)
    put = publisher.put
    session.declare_subscriber(
        observation_key(RUN, credential.node), Callback(lambda sample: put(sample.payload), indirect=False)
    )
    # Messages published before the session knows of a subscriber are lost.
    while not publisher.matching_status.matching:
        time.sleep(0.01)
    put(b"")  # arrives after the subscription
    signal.pause()


def echo_rate(count: int, ticks: int, payload_bytes: int, niceness: int = 0) -> float:
    """Return the robot ticks per second that `count` processes echo, over `ticks` rounds after 10 rounds to warm up.

    `niceness` is added to the niceness of the robots' processes.
    """
    prepare(count)
    set_threads(TWO_THREADS)
    with contextlib.ExitStack() as stack:
        directory = Path(tempfile.mkdtemp(prefix="zwerm-"))
        stack.callback(shutil.rmtree, directory)
        endpoint = f"{UNIX_PROTOCOL}/{directory}/router"
        credentials = issue(RUN, range(count))
        settings = router_settings(credentials, [endpoint], directory / "passwords")
        session = open_session({"mode": "router", **settings}, "echo")
        stack.callback(session.close)
        messages = session.declare_subscriber(command_key(RUN, EVERY), FifoChannel(2 * count))
        publishers = [
            session.declare_publisher(observation_key(RUN, node), express=True, congestion_control=BLOCK)
            for node in range(count)
        ]
        context = multiprocessing.get_context("forkserver")
        for first in range(0, count, JOINING_MAX):
            wave = credentials.nodes[first : first + JOINING_MAX]
            with main_module_hidden():
                for credential in wave:
                    process = context.Process(target=echo, args=(credential, endpoint, niceness), daemon=True)
                    process.start()
                    stack.callback(process.join)
                    stack.callback(process.kill)
            for _ in wave:
                messages.recv()
        payload = bytes(payload_bytes)

        def go_round(rounds: int) -> float:
            puts = [publisher.put for publisher in publishers]
            recv = messages.recv
            began_s = time.perf_counter()
            for _ in range(rounds):
                for put in puts:
                    put(payload)
                for _ in puts:
                    recv().payload.to_bytes()
            return count * rounds / (time.perf_counter() - began_s)

        go_round(10)
        return go_round(ticks)


def main() -> None:
    """Print one rate."""
    parser = argparse.ArgumentParser(description="Bare Zenoh echo: robot ticks a second.")
    parser.add_argument("count", type=int, nargs="?", default=100)
    parser.add_argument("--ticks", type=int, default=200)
    parser.add_argument("--bytes", type=int, default=100)
    given = parser.parse_args()
    print(f"{given.count} processes: {echo_rate(given.count, given.ticks, given.bytes):.0f} robot-ticks/s")


if __name__ == "__main__":
    from benchmarks.common.echo import (
        main as importable_main,  # robots import this module instead of running the program
    )

    importable_main()
