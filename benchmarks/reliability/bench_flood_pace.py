"""The pace of a run in lock-step while a session with a stolen password and another Zenoh id floods its router.

A world and four robots run over TCP, and over a Unix socket of `zwerm world`. There the router cuts such a session off when
all robots have joined. Each run is paired with one without an attack. The attacker opens a session, sends frames that it
captured from another one as fast as the router takes them, and connects again when it is cut off. It runs on the same
machine, at the lowest priority; with `chrt -r 10` before the command all have a higher one than other work.
"""

import argparse
import contextlib
import json
import os
import socket
import statistics
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import msgspec

from benchmarks.common.csv_rows import add_csv_option, write_csv
from benchmarks.reliability.bench_floods import GUESS_MS, MARK, SETTINGS, capture, program_starter, session
from tests.helpers.frame_proxy import BATCH_BYTES_MAX, FrameProxy
from tests.helpers.waiting import DEADLINE_S, until
from zwerm.deploy.identity import load
from zwerm.errors import LinkError
from zwerm.link.session import Credential
from zwerm.wire.keys import command_key

TICK_S: Final = 0.1
TRANSPORTS: Final = ("tcp", "Unix socket of zwerm world")
LOWEST: Final = 19


class Flooded(NamedTuple):
    """The result of a run, the messages that the attacker sent, and the sessions that it opened."""

    result: dict[str, Any]
    messages: int
    sessions: int


def flood(address: int | str, credential: Credential, message: tuple[bytes, bytes]) -> int:
    """Send a message in one session until the router closes its connection, and return how often."""
    channel, content = message
    batch = content * (BATCH_BYTES_MAX // 2 // len(content))
    sent = 0
    with (
        contextlib.suppress(OSError, LinkError, IndexError),  # closed, maybe before it was open
        FrameProxy(address, wait_s=1) as proxy,
        session(proxy.endpoint, credential, GUESS_MS),
    ):
        while not proxy.ended:
            proxy.send(channel, batch)
            sent += len(batch) // len(content)
    return sent


def attack(address: int | str, keys: Path, ended: Path, message: tuple[bytes, bytes]) -> tuple[int, int]:
    """Flood the router until the file `ended` exists. Return the numbers of messages and sessions. In a process of its own."""
    os.nice(LOWEST)
    if sys.platform == "linux" and os.sched_getscheduler(0) == os.SCHED_RR:  # there niceness has no effect
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(os.sched_get_priority_min(os.SCHED_RR)))
    stolen = load(keys).nodes[1]
    messages = sessions = 0
    while not ended.exists():
        messages += flood(address, msgspec.structs.replace(stolen, zid=f"abc{sessions:x}"), message)
        sessions += 1
    return messages, sessions


def run(transport: str, ticks: int, flooded: bool) -> Flooded:
    """Run a world and its robots, with or without the flood."""
    with TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        keys, address = folder / "keys", free_address(transport, folder)
        endpoint = f"tcp/127.0.0.1:{address}" if isinstance(address, int) else f"unixsock-stream/{address}"

        start = program_starter(folder, stack)
        settings = (*SETTINGS, "--set", f"time.duration_s={ticks * TICK_S}")
        world = start("world", *settings, "--listen", endpoint, "--credentials", str(keys))
        until(lambda: world.poll() is not None or (keys.exists() and keys.stat().st_size), "credentials written")
        credentials = load(keys)
        message = capture(address, credentials.nodes[1], command_key(credentials.run, 0)).message_with(MARK)
        robots = start("robot", "--connect", endpoint, "--credentials", str(keys))
        attacker = stack.enter_context(ProcessPoolExecutor(1, mp_context=get_context("spawn")))
        ended = folder / "ended"
        attacking = attacker.submit(attack, address, keys, ended, message) if flooded else None
        out, _ = world.communicate(timeout=1_000)
        ended.touch()
        messages, sessions = attacking.result() if attacking else (0, 0)
        robots.communicate(timeout=DEADLINE_S)
    return Flooded(json.loads(out), messages, sessions)


def free_address(transport: str, folder: Path) -> int | str:
    """Return a free port, or the path of a socket."""
    if not transport.startswith("tcp"):
        return str(folder / "router")
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


def main() -> None:
    """Measure, print and store the paces, and exit with status 1 where a flood changed a result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=int, default=3_000)
    parser.add_argument("--pairs", type=int, default=3)
    add_csv_option(parser)
    options = parser.parse_args()
    rows, changed = [], False
    for transport in TRANSPORTS:
        pairs = [[run(transport, options.ticks, flooded) for flooded in (False, True)] for _ in range(options.pairs)]
        paces = [[each.result["ticks"] / each.result["wall_s"] for each in pair] for pair in pairs]
        floods = [attacked for _, attacked in pairs]
        seconds = sum(each.result["wall_s"] for each in floods)
        traces = {each.result["trace"] for pair in pairs for each in pair}
        changed |= len(traces) > 1
        rows.append(
            {
                "transport": transport,
                "ticks of a run": str(options.ticks),
                "ticks/s without": f"{statistics.median(without for without, _ in paces):.0f}",
                "ticks/s with the flood": f"{statistics.median(attacked for _, attacked in paces):.0f}",
                "ratio": f"{statistics.median(attacked / without for without, attacked in paces):.2f}",
                "messages sent a second": f"{sum(each.messages for each in floods) / seconds:.0f}",
                "sessions opened": str(sum(each.sessions for each in floods)),
                "sessions cut off": str(sum(each.result["refused"]["reasons"].get("cut-off", 0) for each in floods)),
                "trace": "equal" if len(traces) == 1 else "different",
            }
        )
        print(*rows[-1].values(), sep="\t", flush=True)
    write_csv(options.csv, rows)
    sys.exit(changed)


if __name__ == "__main__":
    main()
