"""Intruders that flood a world over TCP: floods of messages, oversized messages, idle connections, and reads of everything.

Before robots join, a session with the credential of node 1 attacks the other nodes. While robots join and run, a session with
its password but a Zenoh id of its own, repeated handshakes of node 1, sessions with wrong or without passwords, raw
connections that send junk, and connections that never speak attack the router. Zenoh's library sends nothing of a session
that may know no subscriber, so the flood with another id goes by `frame_proxy`: frames of node 1, in that session. The run
is interrupted when the attacks are over. A second run, of `zwerm run`, has connections that never speak on its Unix socket.
The traces must be those of an inline run of as many ticks, no intruder may receive a message, and the worlds must count what
they refused.
"""

import argparse
import contextlib
import json
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import msgspec
import zenoh

from benchmarks.common.csv_rows import add_csv_option, write_csv
from tests.helpers.frame_proxy import BATCH_BYTES_MAX, FrameProxy, replay
from tests.helpers.waiting import DEADLINE_S, until
from zwerm.deploy.identity import load
from zwerm.errors import LinkError
from zwerm.link.session import Credential, open_session
from zwerm.wire.keys import command_key, hello_key, observation_key

ROOT: Final = Path(__file__).parents[2]
ROBOTS: Final = 4
SETTINGS: Final = ("computation-free", "--set", f"robots.count={ROBOTS}", "--set", "time.straggler_s=120.0", "--json")
PROGRAM: Final = (sys.executable, "-c", "from zwerm.cli.app import main; main()")
_LEASE: Final = "transport/link/tx/lease"  # [ms]
_PATIENCE: Final = "transport/link/tx/queue/congestion_control/block/wait_before_close"  # [us]
READS: Final = ("**", "@/**", "@/*/router/**", "@/*/router/config/**")
WRONG_PASSWORDS: Final = 10
HANDSHAKES: Final = 100  # of each kind
GUESS_MS: Final = 4_000
LONG_S: Final = 600.0
MARK: Final = b"captured"
ENDLESS_S: Final = 1e6
LOCAL_DURATION_S: Final = 1_000.0
TICK_S: Final = 0.1  # of the scenario
INTERRUPTED: Final = 130
JUNK_BYTES: Final = 64
JUNK_FRAMES: Final = 10
NO_MESSAGE: Final = 0x1F


def session(endpoint: str, credential: Credential | None, timeout_ms: int = 60_000) -> zenoh.Session:
    """Open a session, with a credential or without one. Raises LinkError where the router refuses it."""
    identity = (
        {}
        if credential is None
        else {
            "id": credential.zid,
            "transport/auth/usrpwd": {"user": credential.user, "password": credential.password},
        }
    )
    settings: dict[str, Any] = {"mode": "client", "connect/endpoints": [endpoint], "connect/timeout_ms": timeout_ms}
    # An attacker waits as long as a busy router needs, so that everything it sends arrives.
    settings |= {"connect/exit_on_failure": True, _PATIENCE: round(1e6 * LONG_S), _LEASE: round(1e3 * LONG_S)}
    return open_session(settings | identity, "refused")


def read_all(intruder: zenoh.Session, run: str) -> int:
    """Ask for everything and subscribe to everything, and return how many messages came by query."""
    keys = (*READS, hello_key(run, 0), observation_key(run, 0))
    # The session itself answers queries for its own connections.
    far = zenoh.Locality.REMOTE
    answers = [
        reply.ok
        for key in keys
        for reply in intruder.get(key, zenoh.handlers.FifoChannel(64), timeout=2.0, allowed_destination=far)
    ]
    for answer in filter(None, answers):
        print("read", answer.key_expr)
    return sum(answer is not None for answer in answers)


def flood(intruder: zenoh.Session, key: str, messages: int) -> int:
    """Put many messages on a key, and return how many the session took."""
    sent = 0
    with contextlib.suppress(zenoh.ZError):  # the world has ended
        # Without a publisher: that would stop sending when it learns that it may know no subscriber.
        for sent in range(1, messages + 1):  # noqa: B007 - the count after the last one
            intruder.put(key, b"forged", congestion_control=zenoh.CongestionControl.BLOCK)
    return sent


def capture(port: int | str, credential: Credential, key: str) -> FrameProxy:
    """Return a closed proxy with the handshake of a session, and the frame of one message that it sent on `key`."""
    with FrameProxy(port) as proxy, session(proxy.endpoint, credential) as victim:
        victim.put(key, MARK, congestion_control=zenoh.CongestionControl.BLOCK)
        until(lambda: any(MARK in frame.messages for frame in list(proxy.frames)), "a frame was captured")
    return proxy


def flood_by_frames(port: int, credential: Credential, captured: FrameProxy, messages: int) -> int:
    """Send a captured message many times in sessions of another credential, and return how often.

    The router closes the connection of each such session.
    """
    channel, message = captured.message_with(MARK)
    most = BATCH_BYTES_MAX // 2 // len(message)
    sent = 0
    while sent < messages:
        with (
            contextlib.suppress(OSError, LinkError, IndexError),  # closed, maybe before it was open
            FrameProxy(port, wait_s=1) as proxy,
            session(proxy.endpoint, credential, GUESS_MS),
        ):
            while sent < messages and not proxy.ended:
                count = min(most, messages - sent)
                proxy.send(channel, message * count)
                sent += count
    return sent


def junk(port: int, connections: int, frames: int) -> int:
    """Send random bytes in frames as Zenoh's over connections without a handshake, and return how many were closed.

    No frame begins with the number of the message that begins a handshake.
    """
    closed = 0
    frame = struct.Struct(f"<HB{JUNK_BYTES - 1}s")
    for _ in range(connections):
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=DEADLINE_S) as raw:
                raw.sendall(
                    b"".join(frame.pack(JUNK_BYTES, NO_MESSAGE, os.urandom(JUNK_BYTES - 1)) for _ in range(frames))
                )
                raw.recv(1)
        except ConnectionRefusedError:  # the world has ended
            break
        except (ConnectionResetError, BrokenPipeError):  # closed before all was read
            pass
        closed += 1
    return closed


def listed(port: int, count: int) -> list[socket.socket]:
    """Open connections that never speak."""
    return [socket.create_connection(("127.0.0.1", port), timeout=5.0) for _ in range(count)]


def holds(value: str, asked: str) -> bool:
    """Return whether a value is what is asked for: nothing, the same, or at least a number."""
    return int(value) >= int(asked[3:]) if asked.startswith(">= ") else asked in ("", value)


def idle_on_a_local_run(folder: Path, settings: Sequence[str], count: int) -> dict[str, Any]:
    """Run robots as processes while connections to the Unix socket of the run never speak, and return the result."""
    command = [*PROGRAM, "run", *settings, "--security-log", "local.jsonl"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": str(folder)}
    with subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as running:
        sockets = folder.glob("zwerm-*/router")
        until(lambda: running.poll() is not None or any(folder.glob("zwerm-*/router")), "the run has a socket")
        opened = []
        for path in sockets:
            for _ in range(count):
                opened.append(socket.socket(socket.AF_UNIX))
                opened[-1].settimeout(DEADLINE_S)
                opened[-1].connect(str(path))
        out, _ = running.communicate(timeout=LONG_S)
        for each in opened:
            each.close()
    found: dict[str, Any] = json.loads(out)
    return found | {"opened": len(opened), "exit": running.returncode}


def trace_inline(ticks: int) -> str:
    """Return the trace of an inline run of so many ticks."""
    command = [*PROGRAM, "run", *SETTINGS, "--set", f"time.duration_s={ticks * TICK_S}", "--inline"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return str(json.loads(ran.stdout)["trace"])


def program_starter(folder: Path, stack: contextlib.ExitStack) -> "Callable[..., subprocess.Popen[str]]":
    """Return a function that starts the program in a folder, with these arguments; it ends with `stack`."""

    def start(*arguments: str) -> "subprocess.Popen[str]":
        process = subprocess.Popen(
            [*PROGRAM, *arguments],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        stack.callback(process.communicate)
        stack.callback(process.kill)
        return process

    return start


def main() -> None:
    """Attack a world, print and store what came of it, and exit with status 1 where it is not as documented."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=100_000, help="of each flood")
    parser.add_argument("--connections", type=int, default=10_000, help="that send junk, in 10 frames each")
    parser.add_argument("--oversized", type=int, default=5, help="oversized messages")
    parser.add_argument("--mebibytes", type=int, default=100, help="of each oversized message")
    parser.add_argument("--idle", type=int, default=1_000, help="connections that never speak")
    add_csv_option(parser)
    options = parser.parse_args()
    settings, short = ((*SETTINGS, "--set", f"time.duration_s={each}") for each in (ENDLESS_S, LOCAL_DURATION_S))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    endpoint, big = f"tcp/127.0.0.1:{port}", bytes(options.mebibytes << 20)
    tried: dict[str, int] = {}
    received: list[int] = [0]
    with TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        keys = folder / "keys"

        start = program_starter(folder, stack)
        world = start(
            *("world", *settings, "--listen", endpoint, "--credentials", str(keys)),
            *("--outage", str(LONG_S), "--security-log", "log.jsonl"),
        )
        until(lambda: world.poll() is not None or (keys.exists() and keys.stat().st_size), "credentials written")
        credentials = load(keys)
        own, run = credentials.nodes[1], credentials.run

        def hear(sample: zenoh.Sample) -> None:
            received[0] += 1

        captured = capture(port, own, command_key(run, 0))
        with session(endpoint, own) as insider:
            insider.declare_subscriber("**", hear, allowed_origin=zenoh.Locality.REMOTE)
            tried["flood with the credential of another node"] = flood(insider, command_key(run, 0), options.messages)
            received[0] += read_all(insider, run)
            for number in range(options.oversized):
                insider.put(command_key(run, 1), big, congestion_control=zenoh.CongestionControl.BLOCK)
                tried[f"messages of {options.mebibytes} MiB with a right credential"] = number + 1
            # The router answers in order: after the answer it has seen the whole flood.
            list(insider.get(hello_key(run, 1), zenoh.handlers.FifoChannel(1), payload=b"junk", timeout=LONG_S))
        thief = stack.enter_context(session(endpoint, msgspec.structs.replace(own, zid="abc")))
        thief.declare_subscriber("**", hear, allowed_origin=zenoh.Locality.REMOTE)
        idle = listed(port, options.idle)
        tried["connections that never speak"] = len(idle)

        def steal() -> None:
            received[0] += read_all(thief, run)
            other = msgspec.structs.replace(own, zid="def")
            tried["flood with the password and another id"] = flood_by_frames(port, other, captured, options.messages)

        def repeat() -> None:
            for fresh in (False, True):
                for _ in range(HANDSHAKES):
                    received[0] += replay(port, captured.handshake, fresh_cookie=fresh)
            tried["captured handshakes, repeated"] = HANDSHAKES
            tried["captured handshakes, repeated with the cookie of the new connection"] = HANDSHAKES

        def raw() -> None:
            tried["connections with junk instead of a handshake"] = junk(port, options.connections, JUNK_FRAMES)

        def guess() -> None:
            for number in range(WRONG_PASSWORDS):
                wrong = None if number % 2 else msgspec.structs.replace(own, password=f"guess {number}")
                with contextlib.suppress(LinkError), session(endpoint, wrong, GUESS_MS):
                    received[0] += 1  # it was admitted
                tried["sessions with a wrong password or none"] = number + 1

        robots = start("robot", "--connect", endpoint, "--credentials", str(keys))
        for attack in (steal, repeat, raw, guess):
            attack()
        world.send_signal(signal.SIGINT)
        out, err = world.communicate(timeout=LONG_S)
        _, said = robots.communicate(timeout=DEADLINE_S)
        for each in idle:
            each.close()
        local = idle_on_a_local_run(folder, short, options.idle)
        left = [each.name for each in folder.iterdir() if each.name not in ("log.jsonl", "keys", "local.jsonl")]
    if world.returncode != INTERRUPTED or robots.returncode:
        raise SystemExit(f"world {world.returncode}, robots {robots.returncode}:\n{err}\n{said}")
    found, refused = json.loads(out), json.loads(out)["refused"]["reasons"]
    unix = local["refused"]["reasons"]
    trace, local_trace = (trace_inline(ticks) for ticks in (found["ticks"], local["ticks"]))
    tried["connections that never speak, on the Unix socket of a local run"] = local["opened"]
    # The flood, and reads; Zenoh tries wrong passwords again within the timeout of a session.
    expected = {
        "denied": f">= {options.messages}",  # the flood with a right id
        "foreign-session": ">= 2",
        "cut-off": ">= 2",
        "schema": "1",  # the hello after the flood
        "handshake": str(options.connections + HANDSHAKES),
        "oversized": str(options.oversized),
        "password": f">= {WRONG_PASSWORDS + HANDSHAKES}",
        "silent": str(options.idle),
    }
    rows = [
        *((what, str(count), "") for what, count in tried.items()),
        ("ticks of the run", str(found["ticks"]), ">= 1"),
        ("messages that intruders received, and sessions that they opened without a password", str(received[0]), "0"),
        ("trace", "equal" if found["trace"] == trace else "different", "equal"),
        ("trace of the local run", "equal" if local["trace"] == local_trace else "different", "equal"),
        ("lost by the middleware", str(found["middleware_lost"] + local["middleware_lost"]), "0"),
        ("files left", str(len(left)), "0"),
        *((f"counted as {reason}", str(refused.get(reason, 0)), asked) for reason, asked in expected.items()),
        ("counted as silent by the local run", str(unix.get("silent", 0)), str(options.idle)),
        ("counted for other reasons", str(sum(refused.values()) - sum(refused.get(each, 0) for each in expected)), "0"),
    ]
    write_csv(options.csv, [dict(zip(("what", "measured", "asked"), row, strict=True)) for row in rows])
    for row in rows:
        print(*row, sep="\t")
    if not all(holds(value, asked) for _, value, asked in rows):
        raise SystemExit(1)


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    main()
