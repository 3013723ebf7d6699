"""Controllers that attack the run from inside a robot's process. Robot 1 attacks at tick 3; the others drive on."""

import contextlib
import ctypes
import gc
import os
import signal
import socket
import threading
import time
from pathlib import Path

import zenoh
from msgspec import Struct

from zwerm.agents.runtime.contract import Controller
from zwerm.errors import LinkError
from zwerm.link.node_link import ZenohNodeLink
from zwerm.link.session import Credential, open_session
from zwerm.wire.keys import command_key
from zwerm.wire.messages import Command, Observation, Transmission, WheelSpeeds, encode

ATTACKER = 1
AT_TICK = 3
FLOOD = 20_000
# The queue of a connection holds 16 messages. Where it is full, the only thread of the connection blocks, and the connection
# ends after 5 s. The next observation comes after the first answer has left: then 2 BURST + 1 messages are queued at most.
BURST = 6
MEBIBYTE = 2**20


def own_link() -> ZenohNodeLink:
    """Return the connection of this process, which no interface offers to a controller."""
    return next(each for each in gc.get_objects() if isinstance(each, ZenohNodeLink))


class Attacker(Controller):
    """Does nothing but drive: the base of all attacks, and an honest robot beside them."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == ATTACKER and observation.tick == AT_TICK:
            return self.attack(observation) or Command()
        return Command(drive=WheelSpeeds(0.05, 0.04))

    def attack(self, observation: Observation) -> Command | None:
        """Attack."""
        return None


class Junk(Attacker):
    """Sends messages that are no commands."""

    def attack(self, observation: Observation) -> None:
        send = own_link().send
        for _ in range(FLOOD):
            send(b"junk")


class Large(Attacker):
    """Sends commands above the largest size of a command, and one that is above that of the router."""

    def attack(self, observation: Observation) -> None:
        send = own_link().send
        for _ in range(20):
            send(bytes(500_000))
        send(bytes(3 * MEBIBYTE))


class Twice(Attacker):
    """Answers each observation BURST times too often."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == ATTACKER:
            send, answer = own_link().send, encode(Command(tick=observation.tick))
            for _ in range(BURST):
                send(answer)
        return Command(drive=WheelSpeeds(0.05, 0.04))


class Trespasses(Attacker):
    """Writes to the key of another robot without end, in a thread of its own."""

    def attack(self, observation: Observation) -> None:
        link = own_link()
        publisher = link._session.declare_publisher(command_key(link._run, 0))

        def flood() -> None:
            with contextlib.suppress(zenoh.ZError):  # the session is closed
                while True:
                    publisher.put(b"forged")

        threading.Thread(target=flood, daemon=True).start()


class Crowded(Attacker):
    """Returns more packets than a command may hold."""

    def attack(self, observation: Observation) -> Command:
        return Command(outbox=tuple(Transmission("robots", bytes(900)) for _ in range(1_000)))


class NoNumber(Attacker):
    """Drives at no speed that exists."""

    def attack(self, observation: Observation) -> Command:
        return Command(drive=WheelSpeeds(float("nan"), float("inf")))


class Endless(Attacker):
    """Never answers, and ignores the request to end."""

    def attack(self, observation: Observation) -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
        while True:
            pass


class Exits(Attacker):
    """Ends its process at once."""

    def attack(self, observation: Observation) -> None:
        os._exit(0)


class Closes(Attacker):
    """Closes all descriptors of its process."""

    def attack(self, observation: Observation) -> None:
        os.closerange(0, 1_024)


class Scribbles(Attacker):
    """Writes to every descriptor of its process that is no file, and ends."""

    def attack(self, observation: Observation) -> None:
        for number in range(3, 1_024):
            with contextlib.suppress(OSError):
                os.write(number, b"scribbled")
        os._exit(0)


class Disconnects(Attacker):
    """Closes its connection, and goes on."""

    def attack(self, observation: Observation) -> None:
        own_link().close()


class OpensAnotherSession(Attacker):
    """Opens a session with its own password and another Zenoh id, again whenever it is closed."""

    def attack(self, observation: Observation) -> None:
        own = vars(own_link())
        endpoint = own["_place"].rpartition(" at ")[2]
        threading.Thread(target=_open_again, args=(endpoint, own["_credential"]), daemon=True).start()


def _open_again(endpoint: str, credential: Credential) -> None:
    user = {"user": credential.user, "password": credential.password}
    settings = {"mode": "client", "id": "abc", "connect/endpoints": [endpoint], "transport/auth/usrpwd": user}
    while True:
        with (
            contextlib.suppress(LinkError),
            open_session(settings | {"connect/timeout_ms": 1_000}, "closed") as session,
        ):
            while session.info.transports():
                time.sleep(0.01)


class Allocates(Attacker):
    """Allocates 4 GiB in steps of 64 MiB, and writes to all of it."""

    def attack(self, observation: Observation) -> None:
        _ = [bytearray(b"x") * (64 * MEBIBYTE) for _ in range(64)]


class Forks(Attacker):
    """Starts processes that never end, up to 200, past Python, and reports how many it could start."""

    def attack(self, observation: Observation) -> Command:
        started, fork = 0, ctypes.CDLL(None).fork
        for _ in range(200):
            child = fork()
            if child < 0:
                break
            if child == 0:
                signal.pause()
            started += 1
        return Command(telemetry={"started": float(started)})


class SpyTable(Struct, frozen=True):
    """What a spy tries to reach: a port of this machine, a file, and the id of the world's process."""

    port: int
    path: str
    world: int


class Spies(Attacker):
    """Reports what it can reach: the world's process, a private file, a port of this machine, and its user."""

    Parameters = SpyTable

    def attack(self, observation: Observation) -> Command:
        table = self.parameters
        reached = {
            "reads": _can(lambda: Path(table.path).read_text()),
            "connects": _can(lambda: _connect(table.port)),
            "signals": _can(lambda: os.kill(table.world, 0)),
            "sees_memory": _can(lambda: Path(f"/proc/{table.world}/maps").read_text()),
        }
        return Command(telemetry={"user": float(os.getuid()), **{name: float(can) for name, can in reached.items()}})


def _connect(port: int) -> None:
    with socket.socket() as client:
        client.connect(("127.0.0.1", port))


def _can(attempt) -> bool:
    try:
        attempt()
    except OSError:
        return False
    return True
