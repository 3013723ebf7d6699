"""Signals to every role of a run in every phase: the exit status, and whether a process, a socket or a file is left.

Roles: the world, the server that robots are forked from, and a robot. Phases: while robots join, while the run goes on,
while robots leave, and while the picture is drawn, when no robot is left. Signals: interrupt, terminate, hang-up, kill, and
stop; after a stop the world is continued, the others are not. Each run is a command of its own, with a folder of its own for
temporary files. Its robots take 2 s to leave.

Two further roles are `zwerm world` and `zwerm robot`, connected over TCP, while the run goes on.
"""

import argparse
import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.common.csv_rows import add_csv_option, write_csv
from tests.helpers.waiting import until
from zwerm.deploy.runtime_directory import sweep

ROOT: Final = Path(__file__).parents[2]
ROBOTS: Final = 6
SIGNALS: Final = ("INT", "TERM", "HUP", "KILL", "STOP")
PHASES: Final = ("joining", "running", "leaving", "drawing")
ROLES: Final = ("world", "server", "robot", "zwerm world", "zwerm robot")
APART: Final = ("zwerm world", "zwerm robot")
NOBODY: Final = "no robot is left"
RECORDING_END: Final = b"\x89MCAP0\r\n"
LEAVERS: Final = """
import time
from multiprocessing.util import Finalize

from zwerm import Command, Controller


class Lingers(Controller):
    def __init__(self, setup):
        super().__init__(setup)
        Finalize(None, time.sleep, (2.0,), exitpriority=1)

    def step(self, observation):
        return Command()
"""
ENDLESS_S: Final = 1e6
STOPPED_S: Final = 0.5  # between the signals STOP and CONT
ENDED: Final = ("leaving", "drawing")  # phases after the run
INTERRUPTED: Final = 130

# The exit statuses that the documentation allows. A robot or its server that ends while robots join is an error of the
# start (2); in the run it is a crash (1). Afterwards only the world's own end changes the status.
ALLOWED: Final = {
    ("world", "INT"): {INTERRUPTED},
    ("world", "TERM"): {INTERRUPTED},
    ("world", "HUP"): {INTERRUPTED},
    ("world", "KILL"): {-signal.SIGKILL},
    ("world", "STOP"): {0},
}


# The exit statuses of `zwerm world` and `zwerm robot` after a signal to one. Robots that lose their world exit with 3, and
# their command names one of them and exits with 1.
ALLOWED_APART: Final = {
    **{("zwerm world", name): (INTERRUPTED, 0) for name in ("INT", "TERM", "HUP", "STOP")},
    **{("zwerm robot", name): (1, INTERRUPTED) for name in ("INT", "TERM", "HUP")},
    ("zwerm world", "KILL"): (-signal.SIGKILL, 1),
    ("zwerm robot", "KILL"): (1, -signal.SIGKILL),
    ("zwerm robot", "STOP"): (INTERRUPTED, 0),
}


def processes(session: int) -> dict[int, int]:
    """Return the parents of the living processes that descend from a process, itself included."""
    parents = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent = entry.read_text().rpartition(")")[2].split()[:2]
        except OSError:
            continue
        if state != "Z":
            parents[int(entry.parent.name)] = int(parent)
    found = {session: parents.get(session, 0)} if session in parents else {}
    while fresh := {pid: parent for pid, parent in parents.items() if parent in found and pid not in found}:
        found |= fresh
    return found


def robots_of(world: int) -> tuple[int, list[int]]:
    """Return the server of the robots and the robots; 0 and [] while there are none."""
    tree = processes(world)
    for pid, parent in tree.items():
        if parent == world and "multiprocessing.forkserver" in command_of(pid):
            return pid, [each for each, of in tree.items() if of == pid]
    return 0, []


def command_of(pid: int) -> str:
    """Return the command line of a process, or "" once it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


def is_complete(record: Path) -> bool:
    """Return whether a recording has its end, which is written when the run is over."""
    return record.exists() and record.read_bytes()[len(RECORDING_END) :].endswith(RECORDING_END)


def one(role: str, name: str, phase: str) -> str:
    """Carry out one trial, and return what went wrong, or ""."""
    with TemporaryDirectory(prefix="k-") as folder:
        duration_s = 0.5 if phase in ENDED else ENDLESS_S
        Path(folder, "leavers.py").write_text(LEAVERS)
        command = [
            *(sys.executable, "-c", "from zwerm.cli.app import main; main()", "run", "computation-free", "--quiet"),
            *("--set", f"robots.count={ROBOTS}", "--set", f"time.duration_s={duration_s}"),
            *("--set", "time.straggler_s=3.0", "--record", "run.mcap", "--set", "robots.controller=leavers:Lingers"),
        ]
        environment = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": folder, "COLUMNS": "120"}
        with Path(folder, "printed").open("w+b") as printed:
            world = subprocess.Popen(
                command, cwd=folder, env=environment, stdout=printed, stderr=printed, start_new_session=True
            )
            try:
                return _judge(role, name, phase, world, Path(folder))
            except TimeoutError as error:
                return str(error)
            finally:
                for pid in [*processes(world.pid), world.pid]:
                    with contextlib.suppress(OSError):
                        os.kill(pid, signal.SIGKILL)
                world.wait()


def _judge(role: str, name: str, phase: str, world: subprocess.Popen[bytes], folder: Path) -> str:
    record, printed = folder / "run.mcap", folder / "printed"
    if phase == "joining":
        until(lambda: world.poll() is not None or len(robots_of(world.pid)[1]) > 1, "robots start")
    elif phase == "running":
        until(
            lambda: world.poll() is not None or (record.exists() and record.stat().st_size > 100_000), "the run goes on"
        )
    elif phase == "leaving":
        until(lambda: world.poll() is not None or is_complete(record), "the run is over")
    else:
        until(lambda: world.poll() is not None or b"trace" in printed.read_bytes(), "the result is printed")
    server, robots = robots_of(world.pid)
    if phase == "drawing" and robots:
        return f"robots are left while the picture is drawn: {robots}"
    target = {"world": world.pid, "server": server, "robot": robots[0] if robots else 0}[role]
    if not target:
        return "there is nobody to signal"
    everybody = set(processes(world.pid))
    os.kill(target, getattr(signal, f"SIG{name}"))
    if name == "STOP" and role == "world":
        time.sleep(STOPPED_S)
        os.kill(world.pid, signal.SIGCONT)
        if phase not in ENDED:  # it goes on for ever: end it
            until(lambda: phase == "joining" or record.stat().st_size > 200_000, "the run goes on after the stop")
            os.kill(world.pid, signal.SIGINT)
    elif name == "STOP" and role == "server" and phase not in ENDED:
        # A run whose robots are all forked needs the server no more.
        until(lambda: world.poll() is not None or (record.exists() and record.stat().st_size > 200_000), "it goes on")
        if world.poll() is None:
            os.kill(world.pid, signal.SIGINT)
    elif name == "INT" and role != "world" and phase not in ENDED:
        os.kill(world.pid, signal.SIGINT)  # robots and their server ignore it
    until(lambda: world.poll() is not None, "the run ends")
    until(lambda: not any(_alive(pid) for pid in everybody), "all processes end")
    text = printed.read_text(errors="replace")
    if name == "KILL" and role == "world":
        sweep(folder)  # as the next run does
    left = [each.name for each in folder.iterdir() if each.name.startswith(("zwerm-", "pymp-"))]
    if phase == "leaving" and name != "KILL" and b"trace" not in printed.read_bytes():
        return f"the result is lost: {text[-300:]}"
    allowed = _allowed(role, name, phase)
    if world.returncode not in allowed:
        return f"exit status {world.returncode}, expected {sorted(allowed)}: {text[-300:]}"
    if "Traceback" in text:
        return f"a traceback: {text[-300:]}"
    return f"left: {left}" if left else ""


def apart(role: str, name: str) -> str:
    """Carry out one trial with robots that are connected over TCP, and return what went wrong, or ""."""
    with TemporaryDirectory(prefix="k-") as made, socket.create_server(("127.0.0.1", 0)) as probe:
        folder, endpoint = Path(made), f"tcp/127.0.0.1:{probe.getsockname()[1]}"
        probe.close()
        started: list[subprocess.Popen[bytes]] = []

        def start(*arguments: str) -> subprocess.Popen[bytes]:
            environment = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": made, "COLUMNS": "120"}
            with (folder / "printed").open("ab") as printed:
                started.append(
                    subprocess.Popen(
                        [sys.executable, "-c", "from zwerm.cli.app import main; main()", *arguments],
                        cwd=folder,
                        env=environment,
                        stdout=printed,
                        stderr=printed,
                        start_new_session=True,
                    )
                )
            return started[-1]

        try:
            return _judge_apart(role, name, start, endpoint, folder)
        except TimeoutError as error:
            return str(error)
        finally:
            for each in started:
                for pid in [*processes(each.pid), each.pid]:
                    with contextlib.suppress(OSError):
                        os.kill(pid, signal.SIGKILL)
                each.wait()


def _judge_apart(
    role: str, name: str, start: Callable[..., subprocess.Popen[bytes]], endpoint: str, folder: Path
) -> str:
    keys, record = folder / "keys", folder / "run.mcap"
    world = start(
        *("world", "computation-free", "--quiet", "--set", f"robots.count={ROBOTS}", "--record", "run.mcap"),
        *("--set", f"time.duration_s={ENDLESS_S}", "--listen", endpoint, "--credentials", "keys"),
    )
    until(lambda: world.poll() is not None or (keys.exists() and keys.stat().st_size), "the world listens")
    host = start("robot", "--connect", endpoint, "--credentials", "keys")

    def grown(by: int) -> bool:
        return world.poll() is not None or (record.exists() and record.stat().st_size > by)

    until(lambda: host.poll() is not None or grown(100_000), "the run goes on")
    everybody = set(processes(world.pid)) | set(processes(host.pid))
    target = world if role == "zwerm world" else host
    target.send_signal(getattr(signal, f"SIG{name}"))
    if name == "STOP":
        time.sleep(STOPPED_S)
        target.send_signal(signal.SIGCONT)
        size = record.stat().st_size
        until(lambda: grown(size + 50_000), "the run goes on after the stop")
        world.send_signal(signal.SIGINT)
    until(lambda: None not in (world.poll(), host.poll()), "both commands end")
    until(lambda: not any(_alive(pid) for pid in everybody), "all processes end")
    if name == "KILL":
        sweep(folder)  # as the next run does
        if role == "zwerm world":
            keys.unlink()  # stays, for its owner only
    text = (folder / "printed").read_text(errors="replace")
    left = [each.name for each in folder.iterdir() if each.name.startswith(("zwerm-", "pymp-", "keys"))]
    found = (world.returncode, host.returncode)
    if found != ALLOWED_APART[role, name]:
        return f"exit statuses {found}, expected {ALLOWED_APART[role, name]}: {text[-300:]}"
    if "Traceback" in text:
        return f"a traceback: {text[-300:]}"
    return f"left: {left}" if left else ""


def _allowed(role: str, name: str, phase: str) -> set[int]:
    if role == "world":
        ended = ALLOWED[role, name]
        return {INTERRUPTED} if name == "STOP" and phase not in ENDED else ended
    if phase in ENDED:
        return {0}
    if name == "STOP" and role == "server":
        return {2, INTERRUPTED} if phase == "joining" else {INTERRUPTED}
    if name == "INT":  # the robot and its server ignore it, and the trial ends the world
        return {INTERRUPTED}
    return {1, 2} if phase == "joining" else {1}


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--role", choices=ROLES, nargs="+", default=list(ROLES))
    parser.add_argument("--phase", choices=PHASES, nargs="+", default=list(PHASES))
    parser.add_argument("--signal", choices=SIGNALS, nargs="+", default=list(SIGNALS))
    add_csv_option(parser)
    options = parser.parse_args()
    # A job in the background of a shell ignores interrupts, and so would its children.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    found: dict[tuple[str, str], dict[str, str]] = {}
    failures = 0
    for role in options.role:
        for name in options.signal:
            for phase in options.phase:
                row = found.setdefault((role, phase), {"role": role, "phase": phase})
                if role == "robot" and phase == "drawing":
                    row[f"SIG{name}"] = NOBODY  # the trials of the world and the server show it
                    continue
                if role in APART and phase != "running":
                    row[f"SIG{name}"] = ""
                    continue
                trial = partial(apart, role, name) if role in APART else partial(one, role, name, phase)
                wrongs = [wrong for _ in range(options.repeats) if (wrong := trial())]
                failures += len(wrongs)
                row[f"SIG{name}"] = f"{len(wrongs)} of {options.repeats} wrong" if wrongs else "as documented"
                print(role, name, phase, "; ".join(wrongs) or "right", sep="\t", flush=True)
    rows = [row for (role, phase), row in found.items() if role not in APART or phase == "running"]
    write_csv(options.csv, rows)
    if failures:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
