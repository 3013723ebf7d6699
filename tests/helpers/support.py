"""Helpers of several tests: small scenarios, and the processes of this machine."""

import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from zwerm.scenario.load import validate
from zwerm.scenario.tables import Scenario

ROOT = Path(__file__).parents[2]
ROBOTS = ROOT / "tests" / "robots"

# Where Matplotlib keeps its list of fonts. A process with a home of its own would make the list again.
FONT_CACHE = os.environ.get("MPLCONFIGDIR") or str(Path.home() / ".cache" / "matplotlib")

# The command line, without relying on what is on PATH.
ZWERM = ["-c", "from zwerm.cli.app import main; main()"]


def scenario(**tables: Any) -> Scenario:
    """Return a small scenario: four e-pucks in a square, changed by whole tables."""
    base: dict[str, Any] = {
        "name": "small",
        "time": {"dt_s": 0.1, "duration_s": 2.0, "straggler_s": 20.0},
        "arena": {"size_m": [2.0, 2.0]},
        "robots": {"count": 4, "controller": "computation-free", "sensors": [{"kind": "line_of_sight"}]},
    }
    for name, table in tables.items():
        base[name] = base.get(name, {}) | table if isinstance(table, dict) else table
    return validate(base, "small.toml", Path())


def children_of(parent: int) -> set[int]:
    """Return the ids of the living processes whose parent is `parent`."""
    found = set()
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            state, ppid = (entry / "stat").read_text().rsplit(")", 1)[1].split()[:2]
        except OSError:
            continue
        if int(ppid) == parent and state != "Z":
            found.add(int(entry.name))
    return found


def robots_of_this_process() -> set[int]:
    """Return the ids of the robot processes that this process has started; without the forkserver."""
    return {robot for child in children_of(os.getpid()) for robot in children_of(child)}


def gone(pids: set[int]) -> bool:
    """Return whether all processes `pids` have ended; a zombie counts as ended."""
    for pid in pids:
        try:
            if (Path("/proc") / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z":
                return False
        except OSError:
            continue
    return True


def script(path: Path) -> ModuleType:
    """Return a script that is in no package as a module, without running it as a program.

    It finds the modules beside it, as a program does.
    """
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module
