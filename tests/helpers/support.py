"""Helpers of several tests: small scenarios, and the processes of this machine."""

import importlib.util
import os
import signal
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from waiting import until

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


def state_of(pid: int) -> str:
    """Return the letter by which the kernel calls a process's state, "" where it has ended and was waited for."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return ""


def gone(pids: set[int]) -> bool:
    """Return whether all processes `pids` have ended; a zombie counts as ended."""
    return all(state_of(pid) in ("", "Z") for pid in pids)


def stop(pid: int) -> None:
    """Stop a process by SIGSTOP, and return when it has stopped: a busy one runs on for a moment."""
    os.kill(pid, signal.SIGSTOP)
    until(lambda: state_of(pid) == "T", f"process {pid} stopped")


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
