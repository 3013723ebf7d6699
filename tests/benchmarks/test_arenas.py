"""The campaign in given arenas."""

import subprocess
import sys
from pathlib import Path

from support import ROOT


def test_a_campaign_without_any_run_is_an_error_of_one_line(tmp_path: Path) -> None:
    (tmp_path / "rooms-3.toml").write_text("")
    command = [
        sys.executable,
        "-m",
        "benchmarks.algorithms.bench_arenas",
        "--arenas",
        str(tmp_path),
        "--seeds",
        "35",
        "40",
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    last = done.stderr.splitlines()[-1]
    assert last.endswith(f"{tmp_path}: expected arenas of these kinds with numbers from 35 to 40, found none")
