"""A link that is down for 5, 30 and 60 s, and a world that is killed, between network namespaces: what run and robots do.

The world and each of two hosts have a network namespace of their own. The link of the first host is cut while the run goes on,
and comes back. The world gives up a silent connection after 10 s. In the last trial the world is killed, and started again
with the same keys; the hosts are started again, too. Needs Linux and root.
"""

import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.common.csv_rows import add_csv_option, write_csv
from tests.helpers.waiting import DEADLINE_S, until
from zwerm.deploy.network.namespaces import Namespaces, address_of

ROOT: Final = Path(__file__).parents[2]
OUTAGE_S: Final = 10.0
NAMED_WITHIN_S: Final = OUTAGE_S + 5.0  # the promise of docs/concepts/security.md
GROWTH_BYTES: Final = 30_000
SETTINGS: Final = (
    *("--json", "--outage", str(OUTAGE_S), "--record", "run.mcap", "--set", "robots.count=8"),
    *("--set", "time.straggler_s=60.0"),
)


class Trial:
    """A world and two hosts with four robots each, in network namespaces and a folder of their own."""

    def __init__(self, folder: Path, networks: Namespaces) -> None:
        self.folder, self.networks = folder, networks
        self.record = folder / "run.mcap"
        self.started: list[subprocess.Popen[str]] = []

    def start(self, node: int, *arguments: str) -> subprocess.Popen[str]:
        """Start `zwerm ARGUMENTS` in the namespace of a node."""
        program = [sys.executable, "-c", "from zwerm.cli.app import main; main()"]
        process = subprocess.Popen(
            ["nsenter", f"--net={self.networks.path(node)}", *program, *arguments],
            cwd=self.folder,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.started.append(process)
        return process

    def grow(self, world: subprocess.Popen[str], by: int = GROWTH_BYTES) -> None:
        """Wait until the recording has grown, or the world has ended."""
        size = self.record.stat().st_size if self.record.exists() else 0
        until(
            lambda: world.poll() is not None or (self.record.exists() and self.record.stat().st_size > size + by),
            "the run goes on",
        )


@contextlib.contextmanager
def trial() -> Iterator[Trial]:
    """Make the namespaces and the folder of a trial, and end its processes afterwards."""
    with TemporaryDirectory() as name, Namespaces([0, 1, 2]) as networks:
        made = Trial(Path(name), networks)
        try:
            yield made
        finally:
            for each in made.started:
                each.kill()
                each.communicate()


def exit_codes(said: str) -> str:
    """Return the exit codes of robots that `zwerm robot` names."""
    codes = {int(line.split()[-1]) for line in said.splitlines() if "ended with exit code" in line}
    return ", ".join(map(str, sorted(codes))) or "0"


def outage(for_s: float, on_crash: str) -> dict[str, str]:
    """Cut the link of the first of two hosts for a time, and return the outcome."""
    endpoint = f"tcp/{address_of(0)}:7447"
    with trial() as made:
        keys = made.folder / "robots.key"

        def host(node: int) -> subprocess.Popen[str]:
            ids = "0-3" if node == 1 else "4-7"
            return made.start(node, "robot", "--connect", endpoint, "--credentials", str(keys), "--ids", ids)

        world = made.start(
            0, "world", "computation-free", "--listen", endpoint, "--plain", "--credentials", str(keys), *SETTINGS,
            "--set", "time.duration_s=1e6", "--set", f"robots.on_crash={on_crash}",
        )  # fmt: skip
        until(lambda: world.poll() is not None or (keys.exists() and keys.stat().st_size), "credentials written")
        hosts = [host(1), host(2)]
        made.grow(world)
        made.networks.run(["ip", "link", "set", "node1", "down"])
        time.sleep(for_s)
        made.networks.run(["ip", "link", "set", "node1", "up"])
        returned = ""
        if world.poll() is None:
            made.grow(world)
            made.grow(world)
            if hosts[0].poll() is not None:
                _, returned = host(1).communicate(timeout=DEADLINE_S)
            world.send_signal(signal.SIGINT)
        out, err = world.communicate(timeout=DEADLINE_S)
        said = hosts[0].communicate(timeout=DEADLINE_S)[1]
        result = json.loads(out)
        return {
            "event": f"link down for {for_s:g} s",
            "on_crash": on_crash,
            "world": result["outcome"] + (": " + err.splitlines()[-1][:90] if result["outcome"] == "failed" else ""),
            "robots lost": str(len(result["nodes"]["crashed"])),
            "their exit status": exit_codes(said),
            "lost by the middleware": str(result["middleware_lost"]),
            "the host that joins again": "refused: returned" if "returned" in returned else returned[-80:].strip(),
        }


def restart() -> dict[str, str]:
    """Kill the world, start it again with the same keys, and return the outcome."""
    endpoint = f"tls/{address_of(0)}:7447"
    with trial() as made:
        hosts_of = ("--name", address_of(0), "--host", "first=0-3", "--host", "second=4-7")
        made.start(0, "keys", "computation-free", "keys", *hosts_of, "--set", "robots.count=8").communicate()

        def world(duration_s: float) -> subprocess.Popen[str]:
            return made.start(
                0, "world", "computation-free", "--listen", endpoint, "--keys", "keys/world.key", *SETTINGS,
                "--set", f"time.duration_s={duration_s}",
            )  # fmt: skip

        def hosts() -> list[subprocess.Popen[str]]:
            return [
                made.start(node, "robot", "--connect", endpoint, "--credentials", f"keys/{name}.key")
                for node, name in ((1, "first"), (2, "second"))
            ]

        first, robots = world(1e6), hosts()
        made.grow(first)
        first.kill()
        first.communicate()
        codes = {exit_codes(each.communicate(timeout=NAMED_WITHIN_S)[1]) for each in robots}
        made.record.unlink()
        second, robots = world(30.0), hosts()
        out, err = second.communicate(timeout=DEADLINE_S)
        said = [each.communicate(timeout=DEADLINE_S) for each in robots]
        joined = not any(each.returncode for each in robots)
        result = json.loads(out) if out else {"outcome": f"no result: {err[-200:]}", "nodes": {"crashed": []}}
        return {
            "event": "world killed, started again with its keys",
            "on_crash": "fail",
            "world": f"killed; the second run: {result['outcome']}",
            "robots lost": "8",
            "their exit status": ", ".join(sorted(codes)),
            "lost by the middleware": str(result.get("middleware_lost", "")),
            "the host that joins again": "joins the second run" if joined else said[0][1][-200:],
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, nargs="+", default=[5.0, 30.0, 60.0])
    parser.add_argument("--no-restart", action="store_true", help="leave out the world that is killed")
    add_csv_option(parser)
    options = parser.parse_args()
    rows = []
    for for_s in options.seconds:
        for on_crash in ("fail", "continue"):
            rows.append(outage(for_s, on_crash))
            print(*rows[-1].values(), sep="\t", flush=True)
    if not options.no_restart:
        rows.append(restart())
        print(*rows[-1].values(), sep="\t", flush=True)
    write_csv(options.csv, rows)


if __name__ == "__main__":
    main()
