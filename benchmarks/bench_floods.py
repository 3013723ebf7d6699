"""Intruders that flood a world over TCP: floods of messages, oversized messages, idle connections, and reads of everything.

Before robots join, a session with the credential of node 1 attacks the other nodes. While robots join and run, a session with
its password but a Zenoh id of its own, sessions with wrong or without passwords, raw connections that send junk, and
connections that never speak attack the router. The trace must be that of an inline run, no intruder may receive a message,
and the world must count what it refused.
"""

import argparse
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import msgspec
import zenoh
from csv_rows import add_csv_option, write_csv
from waiting import DEADLINE_S, until

from zwerm.deploy.identity import load
from zwerm.errors import LinkError
from zwerm.link.session import Credential, open_session
from zwerm.wire.keys import command_key, hello_key, observation_key

ROOT: Final = Path(__file__).parents[1]
ROBOTS: Final = 4
SETTINGS: Final = ("computation-free", "--set", f"robots.count={ROBOTS}", "--set", "time.straggler_s=120.0", "--json")
PROGRAM: Final = (sys.executable, "-c", "from zwerm.cli.app import main; main()")
READS: Final = ("**", "@/**", "@/*/router/**", "@/*/router/config/**")
WRONG_PASSWORDS: Final = 20
JUNK_BYTES: Final = 64


def session(endpoint: str, credential: Credential | None) -> zenoh.Session:
    """Open a session, with a credential or without one. Raises LinkError where the router refuses it."""
    identity = (
        {}
        if credential is None
        else {
            "id": credential.zid,
            "transport/auth/usrpwd": {"user": credential.user, "password": credential.password},
        }
    )
    settings: dict[str, Any] = {"mode": "client", "connect/endpoints": [endpoint], "connect/timeout_ms": 1000}
    return open_session(settings | {"connect/exit_on_failure": True} | identity, "refused")


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
        publisher = intruder.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK)
        for sent in range(1, messages + 1):  # noqa: B007 - the count after the last one
            publisher.put(b"forged")
    return sent


def junk(port: int, messages: int) -> int:
    """Send random bytes in frames as Zenoh's over connections without a handshake, and return how many went out."""
    sent = 0
    while sent < messages:
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=5.0) as raw:
                while sent < messages:
                    raw.sendall(JUNK_BYTES.to_bytes(2, "little") + os.urandom(JUNK_BYTES))
                    sent += 1
        except ConnectionRefusedError:  # the world has ended
            break
        except OSError:  # the router has closed the connection
            sent += 1
    return sent


def listed(port: int, count: int) -> list[socket.socket]:
    """Open connections that never speak."""
    return [socket.create_connection(("127.0.0.1", port), timeout=5.0) for _ in range(count)]


def main() -> None:
    """Attack a world, print and store what came of it, and exit with status 1 where it is not as documented."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=100_000, help="of each flood")
    parser.add_argument("--mebibytes", type=int, default=100, help="of the oversized messages")
    parser.add_argument("--idle", type=int, default=1_000, help="connections that never speak")
    parser.add_argument("--duration-s", type=float, default=200.0, help="virtual time of the run")
    add_csv_option(parser)
    options = parser.parse_args()
    settings = (*SETTINGS, "--set", f"time.duration_s={options.duration_s}")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    inline = subprocess.run(
        [*PROGRAM, "run", *settings, "--inline"], env=environment, capture_output=True, text=True, check=True
    )
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    endpoint, big = f"tcp/127.0.0.1:{port}", bytes(options.mebibytes << 20)
    tried: dict[str, int] = {}
    received: list[int] = [0]
    with TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        keys = folder / "keys"

        def start(*arguments: str) -> "subprocess.Popen[str]":
            process = subprocess.Popen(
                [*PROGRAM, *arguments],
                cwd=folder,
                env=environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
            stack.callback(process.communicate)
            stack.callback(process.kill)
            return process

        world = start(
            *("world", *settings, "--listen", endpoint, "--credentials", str(keys)), "--security-log", "log.jsonl"
        )
        until(lambda: world.poll() is not None or (keys.exists() and keys.stat().st_size), "credentials written")
        credentials = load(keys)
        own, run = credentials.nodes[1], credentials.run

        def hear(sample: zenoh.Sample) -> None:
            received[0] += 1

        with session(endpoint, own) as insider:
            insider.declare_subscriber("**", hear, allowed_origin=zenoh.Locality.REMOTE)
            tried["flood with the credential of another node"] = flood(insider, command_key(run, 0), options.messages)
            received[0] += read_all(insider, run)
            insider.put(command_key(run, 1), big)
            tried[f"{options.mebibytes} MiB with a right credential"] = 1
            # The router answers in order: after the answer it has seen the whole flood.
            list(insider.get(hello_key(run, 1), zenoh.handlers.FifoChannel(1), payload=b"junk", timeout=DEADLINE_S))
        thief = stack.enter_context(session(endpoint, msgspec.structs.replace(own, zid="abc")))
        thief.declare_subscriber("**", hear, allowed_origin=zenoh.Locality.REMOTE)
        idle = listed(port, options.idle)
        tried["connections that never speak"] = len(idle)

        def steal() -> None:
            received[0] += read_all(thief, run)
            with contextlib.suppress(zenoh.ZError):
                thief.put(command_key(run, 1), big)
            tried["flood with the password and another id"] = flood(thief, command_key(run, 0), options.messages)

        def raw() -> None:
            tried["junk without a handshake"] = junk(port, options.messages)

        def guess() -> None:
            for number in range(WRONG_PASSWORDS):
                wrong = None if number % 2 else msgspec.structs.replace(own, password=f"guess {number}")
                with contextlib.suppress(LinkError), session(endpoint, wrong):
                    received[0] += 1  # it was admitted
                tried["sessions with a wrong password or none"] = number + 1

        attacks = [threading.Thread(target=each) for each in (steal, raw, guess)]
        for attack in attacks:
            attack.start()
        robots = start("robot", "--connect", endpoint, "--credentials", str(keys))
        out, err = world.communicate(timeout=DEADLINE_S)
        _, said = robots.communicate(timeout=DEADLINE_S)
        for attack in attacks:
            attack.join()
        for each in idle:
            each.close()
        left = [each.name for each in folder.iterdir() if each.name not in ("log.jsonl", "keys")]
    if world.returncode or robots.returncode:
        raise SystemExit(f"world {world.returncode}, robots {robots.returncode}:\n{err}\n{said}")
    found, refused = json.loads(out), json.loads(out)["refused"]
    same = found["trace"] == json.loads(inline.stdout)["trace"]
    rows = [
        *((what, str(count), "") for what, count in tried.items()),
        ("messages that intruders received", str(received[0]), "0"),
        ("trace", "equal" if same else "different", "equal"),
        ("lost by the middleware", str(found["metrics"].get("middleware_lost", found.get("middleware_lost", 0))), "0"),
        ("files left", str(len(left)), "0"),
        *((f"counted as {reason}", str(count), "") for reason, count in sorted(refused["reasons"].items())),
    ]
    write_csv(options.csv, [dict(zip(("what", "measured", "asked"), row, strict=True)) for row in rows])
    for row in rows:
        print(*row, sep="\t")
    if any(asked not in ("", value) for _, value, asked in rows):
        raise SystemExit(1)


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    main()
