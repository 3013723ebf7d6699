"""Whole runs in real processes over real Zenoh: their end, their output, and no files or processes left behind."""

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from support import ROBOTS, ROOT, ZWERM, children_of, gone, scenario
from waiting import until

from zwerm.run.runner import Runner, run


def troubled(controller: str, **robots: object) -> dict[str, object]:
    return {"controller": f"troubled:{controller}", "sensors": [], **robots}


@pytest.mark.parametrize("runner", ["inline", "processes"])
def test_a_controller_that_raises_fails_the_run_with_its_traceback(runner: Runner, nothing_left: None) -> None:
    result = run(scenario(robots=troubled("Raises")), runner=runner)
    assert result.outcome == "failed"
    assert result.reason == "node 2 crashed at tick 5: ZeroDivisionError: division by zero (troubled.py:16, in step)"
    assert result.crashed == [2]
    assert "troubled.py" in result.tracebacks[2]
    assert not result.ok


@pytest.mark.parametrize("runner", ["inline", "processes"])
def test_a_controller_that_raises_ends_only_its_node_if_on_crash_is_continue(
    runner: Runner, nothing_left: None
) -> None:
    result = run(scenario(robots=troubled("Raises", on_crash="continue")), runner=runner)
    assert (result.outcome, result.crashed, result.ticks) == ("time-limit", [2], 20)
    tracks = result.history.arrays()
    assert (tracks.position[6, 2] == tracks.position[-1, 2]).all(), "a crashed robot's motors stop"
    assert (tracks.position[6, 0] != tracks.position[-1, 0]).any()


def test_a_robot_killed_mid_run_fails_the_run_and_is_named(nothing_left: None) -> None:
    result = run(scenario(robots=troubled("Dies")))
    assert result.outcome == "failed"
    assert result.reason == "node 2 crashed at tick 5: its process was ended by signal 9 (SIGKILL)"


def test_a_robot_killed_mid_run_does_not_end_the_run_if_on_crash_is_continue(nothing_left: None) -> None:
    result = run(scenario(robots=troubled("Dies", on_crash="continue")))
    assert (result.outcome, result.crashed, result.ticks) == ("time-limit", [2], 20)
    assert result.middleware_lost == 0


def test_a_straggler_ends_the_run_with_its_name(nothing_left: None, impatient: None) -> None:
    result = run(scenario(robots=troubled("Hangs"), time={"straggler_s": 0.5}))
    assert result.outcome == "failed"
    assert result.reason == "tick 3: no command from node 1 within 0.5 s"
    assert result.middleware_lost == 0, "a controller that hangs is no loss of the middleware"


@pytest.mark.parametrize("runner", ["inline", "processes"])
def test_a_run_completes_when_every_robot_is_done(runner: Runner, nothing_left: None) -> None:
    result = run(scenario(robots=troubled("Finishes", count=6)), runner=runner)
    assert (result.outcome, result.ticks) == ("completed", 6)


def test_in_real_time_late_commands_count_and_silent_robots_stop(nothing_left: None) -> None:
    chosen = scenario(robots=troubled("Slow"), time={"dt_s": 0.02, "duration_s": 1.2, "deadman_s": 0.1})
    result = run(chosen, realtime=1.0)
    assert result.outcome == "time-limit"
    assert result.ticks == 60
    assert result.metrics["deadman_stops"] == 1
    assert result.metrics["late_commands"] >= 5
    assert result.wall_s >= 59 * 0.02, "the last tick begins at this time"
    assert result.middleware_lost == 0


def test_real_time_is_paced_by_its_factor(nothing_left: None) -> None:
    for factor in (8.0, 4.0):
        result = run(scenario(time={"duration_s": 4.0}), runner="inline", realtime=factor)
        assert result.wall_s >= 3.9 / factor, "the last tick begins at this time"
        assert result.metrics["late_commands"] == 0


def start(*arguments: str) -> subprocess.Popen[str]:
    """Start the command line in a process group of its own, as a terminal does."""
    environment = os.environ | {"PYTHONPATH": f"{ROOT}:{ROBOTS}"}
    return subprocess.Popen(
        [sys.executable, *ZWERM, *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def descendants(pid: int) -> set[int]:
    found = children_of(pid)
    return found | {below for child in found for below in descendants(child)}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_stops_everything_reports_the_run_so_far_and_exits_130(
    number: int, tmp_path: Path, nothing_left: None
) -> None:
    running = start(
        "run", "computation-free", "--set", "time.duration_s=1e6", "--set", "robots.count=4", "--json", "--picture",
        str(tmp_path / "run.png"),
    )  # fmt: skip
    robots: set[int] = set()

    def started() -> bool:
        robots.update(descendants(running.pid))
        return len(robots) >= 6  # the fork server, its tracker, and four robots

    until(started, "robots started")
    os.killpg(running.pid, number)
    out, err = running.communicate(timeout=30)
    assert running.returncode == 130, err
    if out:
        found = json.loads(out)
        assert found["outcome"] == "interrupted"
        assert (tmp_path / "run.png").stat().st_size > 0
    assert "Traceback" not in err
    until(lambda: gone(robots), "all processes ended", 5.0)


@pytest.mark.parametrize("loaded", ["msgspec", "typer", "pydantic"])
def test_an_interrupt_while_the_program_is_still_loading_exits_130_without_a_traceback(loaded: str) -> None:
    running = subprocess.Popen(
        [sys.executable, "-X", "importtime", "-m", "zwerm", "run", "computation-free", "--inline", "--set",
         "time.duration_s=1e6"],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert running.stderr is not None
    for line in running.stderr:  # each module, once it is loaded
        if line.rstrip().endswith(f" {loaded}"):
            break
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60)
    printed = [each for each in err.splitlines() if not each.startswith("import time:")]
    assert running.returncode == 130, printed
    assert not any("Traceback" in each for each in printed)


def test_an_interrupt_while_a_library_makes_a_class_exits_130(tmp_path: Path) -> None:
    (tmp_path / "typer.py").write_text("exec('raise KeyboardInterrupt')\n")
    path = os.pathsep.join((str(tmp_path), str(ROOT)))
    ran = subprocess.run(
        [sys.executable, "-m", "zwerm", "list"], env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True
    )
    assert (ran.returncode, ran.stderr) == (130, "zwerm: interrupted\n")


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_after_the_command_does_not_change_the_exit_status(name: str) -> None:
    program = (
        "import atexit, signal, sys; from zwerm.__main__ import main; sys.argv = ['zwerm', '--version'];"
        f"atexit.register(signal.raise_signal, signal.{name}); main()"
    )
    ran = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout.startswith("zwerm ")


def test_a_failed_run_exits_1_and_prints_its_traceback_and_reason() -> None:
    running = start("run", "computation-free", "--inline", "--json", "--set", "robots.controller=troubled:Raises")
    out, err = running.communicate(timeout=60)
    assert running.returncode == 1
    assert json.loads(out)["nodes"]["crashed"] == [2]
    assert "ZeroDivisionError: division by zero (troubled.py:16, in step)" in err
    assert (
        err.splitlines()[-1]
        == "zwerm: node 2 crashed at tick 5: ZeroDivisionError: division by zero (troubled.py:16, in step)"
    )


def test_robots_started_elsewhere_join_over_tcp_and_give_the_same_trace(tmp_path: Path) -> None:
    keys = tmp_path / "robots.key"
    sets = ["--set", "time.duration_s=3", "--set", "robots.count=6", "--seed", "4"]
    port = free_port()
    world = start(
        "world", "computation-free", *sets, "--listen", f"tcp/127.0.0.1:{port}", "--credentials", str(keys), "--json"
    )
    until(keys.exists, "credentials written")
    assert keys.stat().st_mode & 0o777 == 0o600
    robots = [
        start("robot", "--connect", f"tcp/127.0.0.1:{port}", "--credentials", str(keys), "--ids", ids)
        for ids in ("0-2", "3-5")
    ]
    out, err = world.communicate(timeout=60)
    assert world.returncode == 0, err
    found = json.loads(out)
    assert found["runner"] == "remote"
    assert found["trace"] == run("computation-free", 4, "inline", ["time.duration_s=3", "robots.count=6"]).trace
    for each in robots:
        _, printed = each.communicate(timeout=30)
        assert each.returncode == 0, printed
    assert not keys.exists(), "credentials are of no use after the run"


@pytest.mark.parametrize(
    ("program", "imported"),
    [
        ("import zwerm.agents.runtime.node", False),
        ("import zwerm\n    zwerm.run('beacon', runner='inline', overrides=['time.duration_s=0.5'])", False),
        (
            "from zwerm.cli.app import app\n"
            "    app(['run', 'beacon', '--inline', '--json', '--set', 'time.duration_s=0.5'], standalone_mode=False)",
            False,
        ),
        ("import zwerm.agents.runtime.process", True),  # a robot's process does, so the test can tell
    ],
)
def test_without_processes_no_transport_is_imported(tmp_path: Path, program: str, imported: bool) -> None:
    script = f"import sys\ntry:\n    {program}\nfinally:\n    print('zenoh' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1:] == [str(imported)], done.stderr
