"""Processor time of the start of the command line, beside that of an empty Python program.

Prints the median of several starts of each command, and its ratio to `python -c pass` in the same environment.
"""

import argparse
import resource
import statistics
import subprocess
import sys

COMMANDS = {
    "python -c pass": ["-c", "pass"],
    "zwerm --help": ["-m", "zwerm", "--help"],
    "zwerm --version": ["-m", "zwerm", "--version"],
    "zwerm list": ["-m", "zwerm", "list"],
    "zwerm show gossip-max": ["-m", "zwerm", "show", "gossip-max"],
}


def start_s(arguments: list[str]) -> float:
    """Return the processor time [s] of one start."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=11)
    repeats = parser.parse_args().repeats
    found = {name: statistics.median(start_s(each) for _ in range(repeats)) for name, each in COMMANDS.items()}
    floor = next(iter(found.values()))
    print(f"{'command':<24} {'processor time [s]':>20} {'ratio':>7}   (median of {repeats})")
    for name, seconds in found.items():
        print(f"{name:<24} {seconds:>20.3f} {seconds / floor:>7.1f}")


if __name__ == "__main__":
    main()
