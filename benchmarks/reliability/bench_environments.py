"""Faults of the environment of a command: outcome, exit status, what it prints, and what it leaves.

Faults: a full disk below the working directory or below the folder for temporary files, a read-only file system, no HOME, a
temporary folder with a path of 90 characters, 256 descriptors, another user, two runs at once, and a working directory that
is deleted before or in a run. Commands: a run with processes, a run inline, a study, a comparison, a world whose robots are
on another host without the fault, and robots whose world is on another host without the fault.

A trial is as documented if its exit status is one of those expected, its failure is told in lines that begin with `zwerm: `,
nothing is a traceback, and no process, socket or temporary file is left. Needs Linux and root.
"""

import argparse
import contextlib
import os
import re
import signal
import socket
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.common.csv_rows import add_csv_option, write_csv
from benchmarks.common.faulty_places import (
    DESCRIPTORS,
    LONG_CHARS,
    MANY,
    OTHER_USER,
    Place,
    deleted_before,
    deleted_later,
    few_descriptors,
    folder_of_another,
    full_disk,
    full_temporary,
    long_path,
    missing_home,
    no_fault,
    no_home,
    other_user,
    read_only,
    too_few_descriptors,
)
from tests.helpers.waiting import DEADLINE_S, until

SESSION: Final = 3  # the place of the session id in /proc/PID/stat, after the name

STUDY: Final = """
scenario = "computation-free"
seeds = 4
set = ["time.duration_s=1.0", "robots.count=3"]
metrics = ["cell_coverage_fraction"]
"""
TWICE: Final = "two at once"
INTERRUPTED: Final = 130
SHORT: Final = ("computation-free", "--set", "robots.count=3", "--set", "time.duration_s=1.0")
LONGER: Final = ("computation-free", "--set", "robots.count=3", "--set", "time.duration_s=100.0")
FILES: Final = ("--record", "run.mcap", "--picture", "run.png", "--security-log", "log.jsonl")
COMMANDS: Final = {
    "run": ("run", *SHORT, *FILES),
    "run --inline": ("run", *SHORT, *FILES, "--inline"),
    "study": ("study", "study.toml", "--jobs", "2", "--out", "rows.parquet"),
    "compare": (
        *("compare", "computation-free", "--variant", "two:robots.count=2", "--variant", "three:robots.count=3"),
        *("--set", "time.duration_s=1.0", "--metrics", "cell_coverage_fraction", "--seeds", "2", "--jobs", "2"),
        *("--out", "rows.parquet"),
    ),
}
HOSTS: Final = ("world", "robot")  # commands that need each other


RAN: Final = {command: {0} for command in (*COMMANDS, *HOSTS)}
NOT_WRITTEN: Final = {command: {2} for command in RAN} | {"robot": {0}}  # robots write nothing
# For each fault: how it is made, the exit statuses that are expected of the commands, and what a failure must name.
FAULTS: Final = {
    "none": (no_fault, RAN, ""),
    "full disk": (full_disk, NOT_WRITTEN, "No space left on device"),
    # Python then takes /tmp.
    "full temporary folder": (full_temporary, RAN, ""),
    "read-only file system": (read_only, NOT_WRITTEN, "no permission to write|Read-only file system"),
    "no HOME": (no_home, RAN, ""),
    "HOME that does not exist": (missing_home, RAN, ""),
    f"temporary path of {LONG_CHARS} characters": (long_path, RAN, ""),
    f"{DESCRIPTORS} descriptors": (few_descriptors, RAN, ""),
    f"{DESCRIPTORS} descriptors, {MANY} robots": (
        too_few_descriptors,
        RAN | {"run": {2}, "robot": {2}},
        "open files, the limit is",
    ),
    "another user": (other_user, RAN, ""),
    "another user, in a folder of root": (folder_of_another, NOT_WRITTEN, "no permission to write|Permission denied"),
    "working directory deleted before": (
        deleted_before,
        NOT_WRITTEN | {"robot": {2}},
        "the working directory was deleted",
    ),
    "working directory deleted in the run": (
        deleted_later,
        NOT_WRITTEN,
        "No such file or directory|working directory was",
    ),
}


# --- trials ---------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def places() -> Iterator[Place]:
    """Make the folders of a trial, and remove them afterwards."""
    with TemporaryDirectory(prefix="e-") as name:
        here, temporary = Path(name, "here"), Path(name, "t")
        here.mkdir()
        temporary.mkdir()
        (here / "study.toml").write_text(STUDY)
        yield Place(here, temporary)


def one(fault: str, command: str) -> tuple[str, str]:
    """Carry out a trial, and return the exit status, and what is wrong or ""."""
    make, expected, names = FAULTS[fault]
    with places() as first, make(first) as place:
        ran = place.start(*COMMANDS[command])
        place.begin(lambda: False)
        printed, said = ran.communicate(timeout=DEADLINE_S)
        return judged(place, ran, printed, said, expected[command], names)


def apart(fault: str, role: str) -> tuple[str, str]:
    """Carry out a trial in which the world or the robots meet the fault, and the others, on another host, do not.

    Returns the exit status of the command with the fault, and what is wrong or "".
    """
    make, expected, names = FAULTS[fault]
    with places() as healthy, places() as first, make(first) as place, exchange() as keys:
        at = {"world": healthy, "robot": healthy} | {role: replace(place, more=())}
        record = at["world"].here / "run.mcap"
        world, endpoint = start_world(at["world"], keys, *place.more)
        robots = None
        if world.poll() is None:
            robots = start_robots(at["robot"], keys, endpoint)
            place.begin(record.exists)
        ends = {}
        if robots is not None:
            ends["robot"] = robots.communicate(timeout=DEADLINE_S)
            if robots.returncode and role == "robot":
                world.send_signal(signal.SIGINT)  # it would wait for other robots
        ends["world"] = world.communicate(timeout=DEADLINE_S)
        ran = world if robots is None or role == "world" else robots
        status, wrong = judged(place, ran, *ends[role], expected[role], names)
        if role == "world" and robots is not None and robots.returncode:
            wrong = "; ".join(
                filter(None, (wrong, f"the robots exit with {robots.returncode}: {ends['robot'][1][-300:]}"))
            )
        if role == "robot" and world.returncode != (INTERRUPTED if ran.returncode else 0):
            wrong = "; ".join(
                filter(None, (wrong, f"the world exits with {world.returncode}: {ends['world'][1][-300:]}"))
            )
        return status, wrong


@contextlib.contextmanager
def exchange() -> Iterator[Path]:
    """Make a folder that every user may write, and yield the path of a file of credentials in it."""
    with TemporaryDirectory(prefix="x-") as name:
        Path(name).chmod(0o777)
        yield Path(name, "robots.key")


def start_world(place: Place, keys: Path, *more: str) -> tuple["subprocess.Popen[str]", str]:
    """Start a world, and return it and its endpoint once it has written its credentials, or has ended."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    world = place.start("world", *LONGER, *FILES, *more, "--listen", endpoint, "--credentials", str(keys))
    until(lambda: world.poll() is not None or (keys.exists() and keys.stat().st_size), "the world listens")
    return world, endpoint


def start_robots(place: Place, keys: Path, endpoint: str) -> "subprocess.Popen[str]":
    """Start the robots of a world; the file of credentials goes to the user of the place."""
    user = int(OTHER_USER) if "python" in place.changes else 0
    os.chown(keys, user, user)
    return place.start("robot", "--connect", endpoint, "--credentials", str(keys))


def judged(
    place: Place, ran: "subprocess.Popen[str]", printed: str, said: str, expected: set[int], names: str
) -> tuple[str, str]:
    """Return the exit status of a command that has ended, and what is wrong or ""."""
    mistakes = [line for line in said.splitlines() if line.startswith("zwerm: ")]
    wrong = []
    if ran.returncode not in expected:
        wrong.append(f"exit status {ran.returncode}, expected {sorted(expected)}: {said[-400:]}")
    if "Traceback" in said + printed:
        wrong.append(f"a traceback: {said[-1500:]}")
    if ran.returncode and not (mistakes and re.search(names, "\n".join(mistakes))):
        wrong.append(f"no line that names it: {said[-400:]}")
    return str(ran.returncode), "; ".join(wrong + left(place, ran.pid))


def left(place: Place, session: int) -> list[str]:
    """Return the processes, files and sockets that a command left."""
    found = []
    with contextlib.suppress(TimeoutError):
        until(lambda: not living(session), "all processes end")
    if living(session):
        found.append(f"left: processes {living(session)}")
    files = [each.name for each in place.temporary.iterdir() if each.name.startswith(("zwerm-", "pymp-"))]
    sockets = [line for line in Path("/proc/net/unix").read_text().splitlines() if str(place.temporary) in line]
    return [*found, *(["left: " + ", ".join(files)] if files else []), *(["left: sockets"] if sockets else [])]


def living(session: int) -> list[int]:
    """Return the processes of a session, and the robots that it started, that live."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError):
            fields = entry.read_text().rpartition(")")[2].split()
            if int(fields[SESSION]) == session and fields[0] != "Z":
                found.append(int(entry.parent.name))
    return found


def pair(command: str) -> tuple[str, str]:
    """Run a command twice at once in one folder: one succeeds, the other may be refused as its files are in use."""
    with places() as place:
        both = [place.start(*COMMANDS[command]) for _ in range(2)]
        ends = [(each, *each.communicate(timeout=DEADLINE_S)) for each in both]
        judgements = [judged(place, *each, {0, 2}, "another (study|comparison|run) is writing to it") for each in ends]
        statuses = sorted(status for status, _ in judgements)
        wrong = [each for _, each in judgements if each]
        if statuses[0] != "0":
            wrong.append("none succeeded")
        return ", ".join(statuses), "; ".join(wrong)


def hosts_at_once(role: str) -> tuple[str, str]:
    """Start two worlds at once in one folder, or the same robots twice: the second is refused, the first is interrupted."""
    with places() as place, places() as other, exchange() as keys:
        world, endpoint = start_world(place, keys, "--set", "time.duration_s=1e6")
        robots = start_robots(other, keys, endpoint)
        until(lambda: world.poll() is not None or (place.here / "run.mcap").exists(), "the run begins")
        if role == "world":
            names, where = "another run is writing to it", place
            second, _ = start_world(place, keys.with_name("second.key"))
        else:
            names, where = "did not join within|before it joined", other
            second = start_robots(other, keys, endpoint)
        refused = second.communicate(timeout=DEADLINE_S)
        world.send_signal(signal.SIGINT)
        ends = [(each, each.communicate(timeout=DEADLINE_S)[1]) for each in (robots, world)]
        expected = {robots: 0, world: INTERRUPTED}
        wrong = [
            f"exit status {each.returncode}: {said[-300:]}" for each, said in ends if each.returncode != expected[each]
        ]
        status, judgement = judged(where, second, *refused, {2}, names)
        first = world if role == "world" else robots
        return f"{first.returncode}, {status}", "; ".join(filter(None, [*wrong, judgement]))


def main() -> None:
    """Carry out all trials, print each, and exit with status 1 where one was not as documented."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fault", nargs="+", choices=[*FAULTS, TWICE], default=[*FAULTS, TWICE])
    parser.add_argument("--command", nargs="+", choices=[*COMMANDS, *HOSTS], default=[*COMMANDS, *HOSTS])
    add_csv_option(parser)
    options = parser.parse_args()
    rows, failures = [], 0
    for fault in options.fault:
        row = {"fault": fault} | dict.fromkeys(options.command, "")
        wrongs = []
        for command in options.command:
            if command in HOSTS:
                status, wrong = hosts_at_once(command) if fault == TWICE else apart(fault, command)
            else:
                status, wrong = pair(command) if fault == TWICE else one(fault, command)
            print(fault, command, status, wrong or "as documented", sep="\t", flush=True)
            row[command] = status
            wrongs += [wrong] if wrong else []
        failures += len(wrongs)
        rows.append(row | {"not as documented": str(len(wrongs))})
    write_csv(options.csv, rows)
    if failures:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
