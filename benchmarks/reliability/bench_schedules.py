"""Schedules of failures in virtual time, by many more seeds than the test suite has.

Link, drivers, admission, supervisor and hosts are the real ones; connections, clocks, deaths and processes are virtual.
The tests of `tests/deploy/test_simulated_*.py` run with the seeds FIRST to LAST. A schedule that breaks a promise fails
its test, which names the seed.
"""

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from benchmarks.common.csv_rows import add_csv_option, write_csv

ROOT: Final = Path(__file__).parents[2]
# The parts that the files of tests are about.
LAYERS: Final = {"failures": "link, drivers and admission", "hosts": "hosts", "supervisor": "supervisor of processes"}


def main() -> None:
    """Run the tests, and print a row for each. Exits with 1 where one failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1000-2999", metavar="FIRST-LAST")
    add_csv_option(parser)
    options = parser.parse_args()
    first, last = map(int, options.seeds.split("-"))
    report = ROOT / "runs" / "schedules.xml"
    report.parent.mkdir(exist_ok=True)
    files = [f"tests/deploy/test_simulated_{layer}.py" for layer in LAYERS]
    subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n", "0", "--junit-xml", str(report), "-k", "not any_number", *files],
        cwd=ROOT,
        env=os.environ | {"SEEDS": options.seeds},
        check=False,
    )
    rows, failed = [], False
    for case in ElementTree.parse(report).iter("testcase"):
        layer = LAYERS[case.attrib["classname"].rpartition("_")[2]]
        promise = re.sub(r"^test_", "", case.attrib["name"]).replace("_", " ")
        broken = case.find("failure") is not None
        failed |= broken
        rows.append(
            {"part": layer, "promise": promise, "seeds": f"{first} to {last}", "broken": "yes" if broken else "no"}
        )
    for row in rows:
        print(*row.values(), sep="\t")
    write_csv(options.csv, rows)
    sys.exit(failed)


if __name__ == "__main__":
    main()
