"""Speed of the same task in Zwerm and in other simulators that install from the package index: Mesa, IR-SIM, VMAS.

Each peer gets a throw-away environment with the release that is pinned here. Robots drive by one bit of line of sight
(`peers/line_of_sight.py`). All peers run in turn, on one core, and the median of the rounds counts. They do not do the same
work: the table says what each includes. VMAS needs PyTorch, of gigabytes; it runs only if `--peers` names it. ARGoS is not on
the index: `peers/argos_swarm.py` runs the task where `argos3` is installed.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Final, NamedTuple

from benchmarks.common.csv_rows import add_csv_option, write_csv

FOLDER: Final = Path(__file__).parent / "peers"


class Peer(NamedTuple):
    """A simulator: its requirement for pip, or "" for this environment; its worker; and the work that it does."""

    requirement: str
    worker: str
    work: str


PEERS: Final = {
    "zwerm": Peer("", "zwerm_swarm.py", "rigid bodies, walls, messages as bytes, trace"),
    "mesa": Peer("mesa==3.3.1", "mesa_swarm.py", "kinematics, no contacts"),
    "ir-sim": Peer("ir-sim==2.12.0", "irsim_swarm.py", "kinematics, checks of collisions, no walls"),
    "vmas": Peer("vmas==1.5.2", "vmas_swarm.py", "soft contacts, 32 worlds at once"),
}


def python_of(peer: Peer, folder: Path) -> Path:
    """Return the interpreter of a peer's environment, which is made in `folder` if it is not there."""
    if not peer.requirement:
        return Path(sys.executable)
    place = folder / peer.requirement.partition("==")[0]
    python = place / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(place)], check=True)
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-compile"]
        subprocess.run([*pip, peer.requirement], check=True)
    return python


def freeze(python: Path) -> str:
    """Return the releases of all packages of an environment, in one line."""
    words = [str(python), "-m", "pip", "freeze", "--disable-pip-version-check"]
    return " ".join(subprocess.run(words, capture_output=True, text=True, check=True).stdout.split())


def rate(python: Path, peer: Peer, robots: int, ticks: int) -> float:
    """Return robot-ticks per second of processor time of one run of a worker, on one thread."""
    environment = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    words = [str(python), str(FOLDER / peer.worker), str(robots), str(ticks)]
    done = subprocess.run(words, env=environment | {"MPLBACKEND": "Agg"}, stdout=subprocess.PIPE, text=True, check=True)
    lines = [line for line in done.stdout.splitlines() if line.startswith('{"rate"')]
    return float(json.loads(lines[-1])["rate"])


def main() -> None:
    """Measure the chosen peers in turn, and print the table and the releases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", nargs="+", choices=list(PEERS), default=["zwerm", "mesa", "ir-sim"])
    parser.add_argument("--robots", type=int, nargs="+", default=[25, 100])
    parser.add_argument("--robot-ticks", type=int, default=20_000, help="robot-ticks of a run")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument(
        "--environments", type=Path, metavar="DIR", help="keep the environments here, and use those there"
    )
    add_csv_option(parser)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.environments or Path(temporary)
        pythons = {name: python_of(PEERS[name], folder) for name in options.peers}
        for name, python in pythons.items():
            if PEERS[name].requirement:
                print(f"{name}: {freeze(python)}", flush=True)
        rows = []
        for robots in options.robots:
            ticks = max(20, options.robot_ticks // robots)
            found: dict[str, list[float]] = {name: [] for name in pythons}
            for _ in range(options.rounds):
                for name, python in pythons.items():
                    found[name].append(rate(python, PEERS[name], robots, ticks))
            for name, rates in found.items():
                print(
                    f"{name:<8} {robots:>5} robots {median(rates):>12,.0f} robot-ticks/s   {PEERS[name].work}",
                    flush=True,
                )
                rows.append(
                    {
                        "simulator": PEERS[name].requirement.replace("==", " ") or name,
                        "robots": f"{robots}",
                        "robot-ticks/s": f"{median(rates):.0f}",
                        "it includes": PEERS[name].work,
                    }
                )
    write_csv(options.csv, rows)


if __name__ == "__main__":
    main()
