"""Robot processes: start, failure and end; no process outlives its swarm."""

import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

import pytest
from network import free_port, tick
from support import ROBOTS, ROOT, children_of, gone, stop
from waiting import until

from zwerm.agents.runtime.contract import Setup
from zwerm.deploy.identity import load, router_settings
from zwerm.deploy.remote import run_robots
from zwerm.deploy.supervisor import interrupts_held, prepare
from zwerm.deploy.swarm import Certificate, LocalSwarm, RemoteSwarm
from zwerm.errors import LinkError
from zwerm.link import Arrival
from zwerm.link.session import open_session
from zwerm.wire.messages import Failure, Observation, encode, open_answer

ECHO = "small_controllers:Echo"
PRIVATE_MB_MAX = 8.0

# Longer than a robot that failed once waited for the world at most.
WAIT_S = 6.0


def members(count: int, controller: str = ECHO) -> dict[int, tuple[str, Setup]]:
    return {node: (controller, Setup(node, "robot", 0.1, (), bytes(16))) for node in range(count)}


def private_mb(pid: int) -> float:
    """Return the memory [MB] that a process shares with no other."""
    try:
        text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    except PermissionError:  # closed to all but root: the resident memory that no file backs is a little more
        _, resident, shared, *_ = map(int, Path(f"/proc/{pid}/statm").read_text().split())
        return (resident - shared) * os.sysconf("SC_PAGESIZE") / 2**20
    fields = [line.split() for line in text.splitlines()[1:]]
    return sum(int(field[1]) for field in fields if field[0] in ("Private_Clean:", "Private_Dirty:")) / 1024


def test_a_swarm_starts_in_any_order_and_leaves_no_process_or_file(nothing_left: None) -> None:
    count = 20
    order = random.Random(4).sample(range(count), count)
    seen: list[tuple[int, int]] = []
    with LocalSwarm("run", members(count), order=order, progress=lambda *each: seen.append(each)) as swarm:
        pids = swarm.supervisor.pids
        assert list(pids) == order
        assert seen == [(joined, count) for joined in range(1, count + 1)]
        assert swarm.link.joined == set(range(count))
        for number in range(3):
            answers = tick(swarm.link, range(count), number)
            assert {open_answer(answer.payload or b"").tick for answer in answers.values()} == {number}
            assert set(answers) == set(range(count))
        assert max(private_mb(pid) for pid in pids.values()) <= PRIVATE_MB_MAX
    assert swarm.supervisor.exit_codes == dict.fromkeys(range(count), 0)
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids.values())
    swarm.close()


def test_one_process_can_run_swarms_one_after_another_and_at_the_same_time(nothing_left: None) -> None:
    with LocalSwarm("one", members(2)) as one, LocalSwarm("two", members(3)) as two:
        assert len(tick(one.link, range(2), 1)) == 2
        assert len(tick(two.link, range(3), 1)) == 3
    with LocalSwarm("one", members(2)) as one:
        assert len(tick(one.link, range(2), 1)) == 2


def test_an_exception_inside_a_swarm_ends_all_its_processes(nothing_left: None) -> None:
    swarm = LocalSwarm("run", members(3))
    with pytest.raises(ZeroDivisionError), swarm:
        _ = 1 / 0
    assert swarm.supervisor.exit_codes == {0: 0, 1: 0, 2: 0}


def test_the_error_names_the_node_that_does_not_join_in_time(nothing_left: None) -> None:
    with pytest.raises(LinkError, match=r"^node 0 did not join within 0.5 s$"):
        LocalSwarm("run", members(1, "small_controllers:NeverMade"), deadline_s=0.5).__enter__()


def test_a_server_of_robots_that_does_not_answer_is_ended_and_named_and_another_one_starts(nothing_left: None) -> None:
    prepare(1)
    server: int = vars(forkserver)["_forkserver"]._forkserver_pid
    stop(server)
    with pytest.raises(LinkError, match=r"^the server that robots are forked from has ended or does not answer: "):
        LocalSwarm("run", members(2), deadline_s=1.0).__enter__()
    with LocalSwarm("run", members(2)) as swarm:
        assert swarm.link.joined == {0, 1}
    assert gone({server})


def test_a_swarm_whose_server_is_stopped_leaves_no_process(nothing_left: None, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("LEAVE_WAIT_S", "TERMINATE_WAIT_S"):
        monkeypatch.setattr(f"zwerm.deploy.supervisor.{name}", 0.5)
    with LocalSwarm("run", members(2)) as swarm:
        robots = set(swarm.supervisor.pids.values())
        server: int = vars(forkserver)["_forkserver"]._forkserver_pid
        stop(server)
    assert gone({server, *robots})
    assert sorted(swarm.supervisor.exit_codes) == [0, 1], "nothing waits for them when this program ends"


def test_a_router_that_takes_no_more_sessions_is_named(nothing_left: None, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: Any) -> dict[str, Any]:
        return router_settings(*arguments) | {"transport/unicast/max_sessions": 1}

    with LocalSwarm("run", members(2)) as swarm:
        assert swarm.takes_sessions()
        assert set(tick(swarm.link, range(2), 0)) == {0, 1}
    with monkeypatch.context() as patched:
        patched.setattr("zwerm.deploy.swarm.router_settings", full)
        patched.setattr("zwerm.deploy.swarm.PROBE_S_MAX", 1.0)
        with pytest.raises(LinkError, match=r"^node [01] .*; the router takes no more sessions$"):
            LocalSwarm("run", members(2), deadline_s=4.0).__enter__()


def test_a_router_of_other_hosts_that_takes_no_more_sessions_is_named(
    nothing_left: None, monkeypatch: pytest.MonkeyPatch, private_tmp: Path
) -> None:
    def full(*arguments: Any) -> dict[str, Any]:
        return router_settings(*arguments) | {"transport/unicast/max_sessions": 1}

    endpoint, keys = f"tcp/127.0.0.1:{free_port()}", private_tmp / "keys"
    ended = threading.Event()

    def occupy() -> None:
        until(lambda: keys.exists() and keys.stat().st_size, "credentials written")
        node = load(keys).nodes[0]
        login = {"user": node.user, "password": node.password}
        settings = {"mode": "client", "id": node.zid, "connect/endpoints": [endpoint], "transport/auth/usrpwd": login}
        with open_session(settings, "no session"):
            ended.wait(30.0)

    occupant = threading.Thread(target=occupy)
    with monkeypatch.context() as patched:
        patched.setattr("zwerm.deploy.swarm.router_settings", full)
        patched.setattr("zwerm.deploy.swarm.PROBE_S_MAX", 1.0)
        occupant.start()
        with pytest.raises(
            LinkError, match=r"^2 nodes did not join within 3 s, .*; the router takes no more sessions$"
        ):
            RemoteSwarm("run", members(2), listen=[endpoint], credentials_file=keys, deadline_s=3.0).__enter__()
    ended.set()
    occupant.join()


def test_the_failure_of_a_controller_arrives_and_its_process_exits_with_1(nothing_left: None) -> None:
    with LocalSwarm("run", {**members(2), 1: members(2, "small_controllers:Wordy")[1]}) as swarm:
        # The other node answers after everything else, as it may under load.
        stop(swarm.supervisor.pids[0])
        for node in range(2):
            swarm.link.send(node, encode(Observation(5, 0.0)))
        said, end = swarm.link.receive(20.0), swarm.link.receive(20.0)
        assert said is not None
        failure = open_answer(said.payload or b"")
        assert isinstance(failure, Failure)
        assert failure.tick == 5
        assert failure.error.startswith("ValueError: xxx")
        assert failure.traceback.endswith("\u2620\n")
        assert end == Arrival(1, None)
        swarm.supervisor.send_signal(0, signal.SIGCONT)
        answer = swarm.link.receive(20.0)
        assert answer is not None
        assert (answer.node, open_answer(answer.payload or b"").tick) == (0, 5)
        until(lambda: 1 in swarm.supervisor.exit_codes, "its process ended")
    assert swarm.supervisor.exit_codes == {0: 0, 1: 1}


def test_a_failed_robot_exits_only_after_the_world_has_confirmed_its_failure(nothing_left: None) -> None:
    with LocalSwarm("run", members(1, "small_controllers:Wordy")) as swarm:
        with swarm.link._lock:  # the world takes in messages, and confirms nothing
            swarm.link.send(0, encode(Observation(5, 0.0)))
            until(lambda: swarm.link._arrivals, "the failure arrived")
            assert not swarm.supervisor.wait(WAIT_S), "no time limit ends its wait"
        said, end = swarm.link.receive(20.0), swarm.link.receive(20.0)
        assert said is not None
        assert isinstance(open_answer(said.payload or b""), Failure)
        assert end == Arrival(0, None)
        assert swarm.supervisor.wait(20.0)
    assert swarm.supervisor.exit_codes == {0: 1}


def test_a_failed_robot_exits_on_sigterm_without_a_confirmation(nothing_left: None) -> None:
    with LocalSwarm("run", members(1, "small_controllers:Wordy")) as swarm, swarm.link._lock:
        swarm.link.send(0, encode(Observation(5, 0.0)))
        until(lambda: swarm.link._arrivals, "the failure arrived")
        swarm.supervisor.send_signal(0, signal.SIGTERM)
        assert swarm.supervisor.wait(20.0)
    assert swarm.supervisor.exit_codes == {0: 1}


@pytest.mark.parametrize(
    ("controller", "error"),
    [
        ("Exits", "SystemExit: 0"),
        ("Cancels", "CancelledError: not mine to raise"),
        ("Recurses", "RecursionError: maximum recursion depth exceeded"),
        ("Garrulous", "ValueError: the command takes 100033 bytes, at most 65536 are allowed"),
        ("Unspeakable", r"ValueError: \udcff"),
    ],
)
def test_every_end_of_a_controller_is_reported_to_the_world(nothing_left: None, controller: str, error: str) -> None:
    with LocalSwarm("run", members(1, f"small_controllers:{controller}")) as swarm:
        failure = open_answer(tick(swarm.link, range(1), 0)[0].payload or b"")
        assert isinstance(failure, Failure)
        assert failure.error.startswith(error)
    assert swarm.supervisor.exit_codes == {0: 1}


def test_robots_exit_when_the_world_is_lost(nothing_left: None) -> None:
    with LocalSwarm("run", members(2)) as swarm:
        swarm.link.close()
        assert swarm.supervisor.wait(20.0)
        assert swarm.supervisor.exit_codes == {0: 3, 1: 3}


def test_a_robot_exits_on_sigterm_and_ignores_sigint(nothing_left: None) -> None:
    with LocalSwarm("run", members(2)) as swarm:
        swarm.supervisor.send_signal(0, signal.SIGINT)
        swarm.supervisor.send_signal(1, signal.SIGTERM)
        assert swarm.link.receive(20.0) == Arrival(1, None)
        assert set(tick(swarm.link, range(1), 0)) == {0}
    assert swarm.supervisor.exit_codes == {0: 0, 1: 0}


def test_hanging_and_paused_robots_are_killed_at_the_end_of_a_run(nothing_left: None) -> None:
    with LocalSwarm("run", {**members(3), 1: members(2, "small_controllers:Spins")[1]}) as swarm:
        swarm.link.send(1, encode(Observation(0, 0.0)))
        stop(swarm.supervisor.pids[2])
        swarm.link.dismiss("over")
        swarm.supervisor.stop(0.5)
        assert swarm.supervisor.exit_codes == {0: 0, 1: -signal.SIGKILL, 2: -signal.SIGKILL}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupt_is_deferred_to_the_end_of_a_protected_block(number: signal.Signals) -> None:
    steps = []

    def start_something() -> None:
        with interrupts_held():
            signal.raise_signal(number)
            steps.append("went on")

    before = signal.signal(number, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            start_something()
        assert steps == ["went on"]
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        signal.signal(number, before)


# --- a program of its own, ended from outside -----------------------------------------------------------------------


def below(pid: int) -> set[int]:
    """Return the ids of all living descendants of `pid`."""
    children = children_of(pid)
    return children | {each for child in children for each in below(child)}


@contextmanager
def program(tmp: Path, count: int, *controllers: str) -> Iterator[subprocess.Popen[str]]:
    """Run swarm_script.py in a process group and with a temporary directory of its own."""
    running = subprocess.Popen(
        [sys.executable, str(ROOT / "tests" / "helpers" / "swarm_script.py"), str(count), *controllers],
        env=os.environ | {"PYTHONPATH": f"{ROOT}:{ROBOTS}", "TMPDIR": str(tmp)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield running
    finally:
        running.kill()
        running.communicate()


def read_until(running: subprocess.Popen[str], line: str) -> None:
    """Read what the program prints up to `line`."""
    assert running.stdout is not None
    for printed in running.stdout:
        if printed.strip() == line:
            return
    pytest.fail(f"the program ended before it printed {line!r}")


@pytest.mark.parametrize("when", ["1", "17", "joined"])
def test_ctrl_c_while_starting_or_running_leaves_no_process_socket_or_directory(private_tmp: Path, when: str) -> None:
    with program(private_tmp, 20, ECHO) as running:
        read_until(running, when)
        started = below(running.pid)
        assert len(started) > 2
        os.killpg(running.pid, signal.SIGINT)
        _, said = running.communicate(timeout=30)
        assert said.splitlines()[-1] == "KeyboardInterrupt"
        assert said.count("Traceback") == 1, "only of the program itself"
        until(lambda: gone(started), "all processes ended")
        assert [path for path in private_tmp.iterdir() if not path.name.startswith("pymp-")] == []


@pytest.mark.parametrize("when", ["2", "joined"])
def test_no_robot_survives_the_kill_of_its_parent_even_if_it_hangs_or_is_paused(private_tmp: Path, when: str) -> None:
    with program(private_tmp, 20, ECHO, "small_controllers:Spins") as running:
        read_until(running, when)
        started = below(running.pid)
        server = next(pid for pid in children_of(running.pid) if children_of(pid))
        statuses = {pid: Path(f"/proc/{pid}/status").read_text() for pid in children_of(server)}
        with_session = [pid for pid, status in statuses.items() if "\nThreads:\t1\n" not in status]
        os.kill(with_session[0], signal.SIGSTOP)
        running.kill()
        until(lambda: gone(started), "all processes ended")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere sessions are not scheduled as groups")
def test_robots_share_the_session_of_the_world_and_each_leads_a_process_group(private_tmp: Path) -> None:
    with program(private_tmp, 4, ECHO) as running:
        read_until(running, "joined")
        server = next(pid for pid in children_of(running.pid) if children_of(pid))
        robots = children_of(server)
        assert len(robots) == 4
        assert {os.getsid(pid) for pid in robots} == {os.getsid(running.pid)}
        assert {pid: os.getpgid(pid) for pid in robots} == {pid: pid for pid in robots}


def test_an_unknown_controller_is_an_error_of_one_line_and_leaves_no_process(private_tmp: Path) -> None:
    with program(private_tmp, 1, "no_such_module:Robot") as running:
        _, said = running.communicate(timeout=30)
    lines = said.splitlines()
    assert lines[0] == "zwerm: cannot import 'no_such_module': No module named 'no_such_module'"
    assert lines[-1] == "zwerm.errors.LinkError: node 0 ended with exit code 2 before it joined"
    assert said.count("Traceback") == 1, "only of the program itself"


# --- robots started elsewhere ---------------------------------------------------------------------------------------


def certificate(directory: Path) -> Certificate:
    """Return a new certificate for localhost, signed by itself."""
    made = Certificate(directory / "cert.pem", directory / "key.pem", directory / "cert.pem")
    subprocess.run(
        f"openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost"
        f" -addext subjectAltName=DNS:localhost -addext basicConstraints=critical,CA:FALSE"
        f" -keyout {made.private_key} -out {made.certificate}".split(),
        check=True,
        capture_output=True,
    )
    return made


@pytest.mark.parametrize("place", ["tcp/127.0.0.1", "tls/localhost", "quic/localhost"])
def test_remote_robots_join_over_a_network_and_exit_with_the_world(nothing_left: None, place: str) -> None:
    directory = Path(tempfile.gettempdir())
    keys, endpoint = directory / "keys", f"{place}:{free_port()}"
    tls = None if place.startswith("tcp") else certificate(directory)
    ticked: list[set[int]] = []
    errors: list[Exception] = []

    def world() -> None:
        try:
            with RemoteSwarm("run", members(3), listen=[endpoint], credentials_file=keys, tls=tls) as swarm:
                ticked.extend(set(tick(swarm.link, range(3), number)) for number in range(2))
        except Exception as error:
            errors.append(error)

    serving = threading.Thread(target=world)
    serving.start()
    until(lambda: errors or (keys.exists() and keys.stat().st_size), "credentials written")
    assert errors == []
    assert run_robots(endpoint, keys, "0-2", deadline_s=20.0) == {0: 0, 1: 0, 2: 0}
    serving.join(20.0)
    assert errors == []
    assert ticked == [{0, 1, 2}, {0, 1, 2}]
    assert not keys.exists()


def test_the_error_names_the_remote_robots_that_do_not_join(private_tmp: Path) -> None:
    swarm = RemoteSwarm(
        "run",
        members(3),
        listen=[f"tcp/127.0.0.1:{free_port()}"],
        credentials_file=private_tmp / "keys",
        deadline_s=0.2,
    )
    with pytest.raises(LinkError, match=r"^3 nodes did not join within 0.2 s, first node 0$"):
        swarm.__enter__()
    assert list(private_tmp.iterdir()) == []


def test_a_world_that_cannot_listen_is_an_error_of_one_line(private_tmp: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(LinkError, match=r"^the world cannot listen: ") as refused:
            RemoteSwarm("run", members(1), listen=[endpoint], credentials_file=private_tmp / "keys").__enter__()
    assert "\n" not in str(refused.value)
    assert list(private_tmp.iterdir()) == []


ORPHAN = """
import os, sys
from zwerm.agents.runtime.process import die_with_parent
parent = os.getpid()
read, write = os.pipe()
if os.fork():
    os._exit(0)
os.close(write)
while os.getppid() == parent:
    os.sched_yield()
print("orphaned", flush=True)
die_with_parent(parent)
print("lives on", flush=True)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the kernel kills no child of a dead process")
def test_a_robot_whose_parent_died_before_it_asked_the_kernel_ends_at_once() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", ORPHAN],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ran.stdout.split("\n") == ["orphaned", ""]
