"""Run the command line in a process of its own."""

import subprocess
import sys
from pathlib import Path

from support import FONT_CACHE, ROOT, ZWERM


def zwerm(*arguments: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Run `zwerm ARGUMENTS` in `cwd`, with 120 columns, and return its exit status and its output as text."""
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "COLUMNS": "120", "HOME": str(cwd)}
    environment["MPLCONFIGDIR"] = FONT_CACHE
    return subprocess.run(
        [sys.executable, *ZWERM, *arguments], cwd=cwd, env=environment, capture_output=True, text=True, timeout=120
    )
