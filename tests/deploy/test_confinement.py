"""Robots confined by the operating system: a user of its own, no network, limits of memory and of processes."""

import contextlib
import os
import socket
import sys
from pathlib import Path
from typing import Any

import pytest
from support import scenario, state_of
from waiting import until

from zwerm.agents.runtime.confinement import Confinement
from zwerm.errors import LinkError, ScenarioError
from zwerm.run.result import RunResult
from zwerm.run.runner import run

FIRST_USER = 61_000

linux = pytest.mark.skipif(sys.platform != "linux", reason="the limits are those of Linux")
root = pytest.mark.skipif(os.geteuid() != 0, reason="only root may give processes another user")


def attacked(attack: str, confinement: Confinement, table: dict[str, Any] | None = None) -> RunResult:
    robots = {"controller": f"malicious:{attack}", "count": 2, "on_crash": "continue", "parameters": table or {}}
    return run(scenario(robots=robots, time={"duration_s": 0.8}), confinement=confinement)


def reported(result: RunResult) -> dict[str, float]:
    """Return the telemetry of the attacking robot."""
    assert result.crash_reasons == {}
    return {str(name): float(value) for name, value in zip(result.telemetry.name, result.telemetry.value, strict=True)}


@linux
def test_a_robot_that_allocates_too_much_fails_alone_and_is_named(nothing_left: None) -> None:
    result = attacked("Allocates", Confinement(memory_mb=200))
    assert result.outcome == "time-limit"
    assert result.crash_reasons[1].startswith("tick 3: MemoryError")
    assert result.crashed == [1]


@linux
@root
def test_a_robot_with_a_user_of_its_own_reaches_nothing_of_the_worlds_user(nothing_left: None, tmp_path: Path) -> None:
    private = tmp_path / "private"
    private.write_text("secret")
    private.chmod(0o600)
    with socket.create_server(("127.0.0.1", 0)) as server:
        table = {"port": server.getsockname()[1], "path": str(private), "world": os.getpid()}
        free, confined = (
            attacked("Spies", each, table) for each in (Confinement(), Confinement(first_user=FIRST_USER))
        )
    reached = ("reads", "connects", "signals", "sees_memory")
    assert reported(free) == {"user": 0.0, **dict.fromkeys(reached, 1.0)}, "the attack works where nothing stops it"
    assert reported(confined) == {"user": FIRST_USER + 1.0, **dict.fromkeys(reached, 0.0)}
    assert confined.trace == free.trace


@linux
@root
def test_no_code_of_a_controller_with_a_user_of_its_own_runs_as_the_worlds_user(nothing_left: None) -> None:
    tables = scenario(robots={"controller": "untrusted:Untrusted", "count": 2}, time={"duration_s": 0.3})
    with pytest.raises(ScenarioError, match="root runs the code of a controller"):
        run(tables)
    result = run(tables, confinement=Confinement(first_user=FIRST_USER))
    assert result.ok, result.reason
    assert set(result.telemetry.value.tolist()) == {FIRST_USER, FIRST_USER + 1.0}
    with pytest.raises(LinkError, match=r"^node 0 ended with exit code 2 before it joined$"):
        run(
            scenario(robots={"controller": "no_such_module:Missing", "count": 1}),
            confinement=Confinement(first_user=FIRST_USER),
        )


@linux
@root
def test_a_robot_starts_no_more_processes_than_allowed_and_all_end_with_the_run(nothing_left: None) -> None:
    result = attacked("Forks", Confinement(first_user=FIRST_USER + 100, processes=5))
    assert reported(result) == {"started": 5.0}
    users = {FIRST_USER + 100, FIRST_USER + 101}
    until(lambda: not running_as(users), "all processes ended")


def running_as(users: set[int]) -> set[int]:
    """Return the ids of the processes of these users; zombies count as ended."""
    found = set()
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended
            if entry.stat().st_uid in users and state_of(int(entry.name)) not in ("", "Z"):
                found.add(int(entry.name))
    return found


def test_what_cannot_be_enforced_is_refused_in_one_line_before_any_process_starts(nothing_left: None) -> None:
    with pytest.raises(
        LinkError, match=r"^a limit of processes needs a user for each robot: .*|^limits of robots need"
    ):
        attacked("Attacker", Confinement(processes=5))
    with pytest.raises(LinkError, match=r"^expected a first user id of 1 to 2147483646, got 0$|need"):
        attacked("Attacker", Confinement(first_user=0))
    with pytest.raises(ScenarioError, match=r"^runner: only robots that are processes can be confined"):
        run(scenario(), runner="inline", confinement=Confinement(memory_mb=1))
