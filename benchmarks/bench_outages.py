"""A link that is down for 5 s and for 30 s, between network namespaces: what the run, the robots and a returning host do.

The world and each of two hosts have a network namespace of their own. The link of the first host is cut while the run goes on,
and comes back. The world gives up a silent connection after 10 s. Needs Linux and root.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from csv_rows import add_csv_option, write_csv
from waiting import DEADLINE_S, until

from zwerm.deploy.network.namespaces import Namespaces, address_of

ROOT: Final = Path(__file__).parents[1]
OUTAGE_S: Final = 10.0
NAMED_WITHIN_S: Final = OUTAGE_S + 5.0  # the promise of docs/security.md
GROWTH_BYTES: Final = 30_000


def outage(for_s: float, on_crash: str) -> dict[str, str]:
    """Cut the link of the first of two hosts for a time, and return the outcome."""
    with TemporaryDirectory() as name, Namespaces([0, 1, 2]) as networks:
        folder, endpoint = Path(name), f"tcp/{address_of(0)}:7447"
        record, keys = folder / "run.mcap", folder / "robots.key"

        def start(node: int, *arguments: str) -> subprocess.Popen[str]:
            program = [sys.executable, "-c", "from zwerm.cli.app import main; main()"]
            return subprocess.Popen(
                ["nsenter", f"--net={networks.path(node)}", *program, *arguments],
                cwd=folder,
                env=os.environ | {"PYTHONPATH": str(ROOT)},
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )

        def grows() -> None:
            size = record.stat().st_size
            until(lambda: world.poll() is not None or record.stat().st_size > size + GROWTH_BYTES, "the run goes on")

        def host(node: int) -> subprocess.Popen[str]:
            ids = "0-3" if node == 1 else "4-7"
            return start(node, "robot", "--connect", endpoint, "--credentials", str(keys), "--ids", ids)

        world = start(
            0, "world", "computation-free", "--listen", endpoint, "--plain", "--credentials", str(keys), "--json",
            "--outage", str(OUTAGE_S), "--record", str(record), "--set", "robots.count=8",
            "--set", "time.duration_s=1e6", "--set", f"robots.on_crash={on_crash}", "--set", "time.straggler_s=60.0",
        )  # fmt: skip
        hosts: list[subprocess.Popen[str]] = []
        try:
            until(lambda: world.poll() is not None or (keys.exists() and keys.stat().st_size), "credentials written")
            hosts = [host(1), host(2)]
            until(lambda: record.exists() and record.stat().st_size > GROWTH_BYTES, "the run begins")
            networks.run(["ip", "link", "set", "node1", "down"])
            time.sleep(for_s)
            networks.run(["ip", "link", "set", "node1", "up"])
            returned = ""
            if world.poll() is None:
                grows()
                grows()
                if hosts[0].poll() is not None:
                    hosts.append(host(1))
                    _, returned = hosts[-1].communicate(timeout=DEADLINE_S)
                world.send_signal(signal.SIGINT)
            out, err = world.communicate(timeout=DEADLINE_S)
            said = [each.communicate(timeout=DEADLINE_S)[1] for each in hosts[:2]]
        finally:
            for each in (world, *hosts):
                each.kill()
                each.communicate()
        result = json.loads(out)
        codes = [int(line.split()[-1]) for line in said[0].splitlines() if "ended with exit code" in line]
        return {
            "link down [s]": f"{for_s:g}",
            "on_crash": on_crash,
            "world": result["outcome"] + (": " + err.splitlines()[-1][:90] if result["outcome"] == "failed" else ""),
            "robots lost": str(len(result["nodes"]["crashed"])),
            "their exit status": ", ".join(sorted({str(code) for code in codes})) or "0",
            "lost by the middleware": str(result["middleware_lost"]),
            "the host that joins again": "refused: returned" if "returned" in returned else returned[-80:].strip(),
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, nargs="+", default=[5.0, 30.0])
    add_csv_option(parser)
    options = parser.parse_args()
    rows = []
    for for_s in options.seconds:
        for on_crash in ("fail", "continue"):
            rows.append(outage(for_s, on_crash))
            print(*rows[-1].values(), sep="\t", flush=True)
    write_csv(options.csv, rows)


if __name__ == "__main__":
    main()
