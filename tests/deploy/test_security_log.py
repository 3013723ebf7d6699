"""The security log: what world and router refuse is counted by reason and node, in the result and in a file."""

import contextlib
import json
import os
import socket
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest
from command_line import zwerm
from frame_proxy import FrameProxy, replay
from network import free_port
from support import ROBOTS, ROOT, ZWERM, scenario
from waiting import until

from zwerm.deploy.identity import load
from zwerm.deploy.router_messages import RefusalParser, RouterEvent
from zwerm.deploy.security_log import LINES_MAX, SecurityLog
from zwerm.errors import LinkError, ScenarioError
from zwerm.link.session import Credential, open_session
from zwerm.run.runner import run
from zwerm.wire.keys import command_key

LOG = b"2026-01-01T00:00:00.000000Z TRACE  rx-0 ThreadId(07) zenoh::net::routing::interceptor::access_control: "
FOREIGN = 7  # messages of a session with a stolen password and another id
SUBJECT = b"f32e on Username(node-1)+Transport(UnixsockStream)+f32e"


def lines_of(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


# --- what the router's log says ---------------------------------------------------------------------------------------


def test_only_what_a_session_tried_is_a_denial_and_not_what_the_router_evaluates_in_advance() -> None:
    parser = RefusalParser()
    said = [
        LOG + b"ACL (ingress): caching permissions for `k` ...",
        LOG + SUBJECT + b" is unauthorized to Put (ingress) on k",  # in advance
        LOG + SUBJECT + b" is authorized to Query (ingress) on k",
        LOG + SUBJECT + b" is unauthorized to Delete (ingress) on k",  # in advance
        LOG + SUBJECT + b" is unauthorized to Put (egress) on k",  # kept from the node
        LOG + b"Using cached result: f32e is unauthorized to Put (ingress) on k",  # tried
        LOG + SUBJECT + b" is unauthorized to Put (ingress) on k",  # tried
        LOG + SUBJECT + b" is unauthorized to Query (ingress) on other",  # tried
    ]
    found = [event for line in said if (event := parser.parse(line)) is not None]
    assert found == [
        RouterEvent("denied", 1, "session f32e: Put on k"),
        RouterEvent("denied", 1, "session f32e: Put on k"),
        RouterEvent("denied", 1, "session f32e: Query on other"),
    ]


def test_a_message_that_is_dropped_without_a_decision_is_a_denial_of_an_unknown_node() -> None:
    dropped = LOG.replace(b"interceptor::access_control", b"interceptor") + b"Msg intercepted!"
    elsewhere = dropped.replace(b"ThreadId(07)", b"ThreadId(08)")
    parser = RefusalParser()
    said = [
        LOG + SUBJECT + b" is unauthorized to Put (ingress) on k",
        elsewhere,  # another thread, for a session without permissions
        dropped,  # the effect of the denial
        dropped,
    ]
    found = [event for line in said if (event := parser.parse(line)) is not None]
    unknown = RouterEvent("denied", -1, "a message of a session that has no permissions")
    assert found == [RouterEvent("denied", 1, "session f32e: Put on k"), unknown, unknown]


def test_the_payload_of_a_message_is_no_report_of_a_refusal() -> None:
    assert RefusalParser().parse(b"... TRACE rx: Received: Frame { Invalid password }") is None


# --- the file ---------------------------------------------------------------------------------------------------------


def test_a_flood_of_refusals_fills_no_disk_and_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "new" / "security.jsonl"
    with SecurityLog(path, router=False) as log:
        for _ in range(LINES_MAX + 500):
            log.note(3, "malformed")
        log.note(-1, "password", "Invalid password")
    *lines, last = lines_of(path)
    assert len(lines) == LINES_MAX + 1
    assert (lines[-1]["node"], lines[-1]["reason"], lines[-1]["detail"]) == (None, "password", "Invalid password")
    assert last["counts"] == {"unknown": {"password": 1}, "3": {"malformed": LINES_MAX + 500}}
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_a_log_that_cannot_be_written_is_an_error_of_one_line_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"^.*: cannot write a security log: Is a directory$"):
        run("gossip-max", runner="inline", security_log=tmp_path)


def test_two_runs_at_once_never_share_a_log(tmp_path: Path) -> None:
    path = tmp_path / "log"
    with SecurityLog(path, router=False) as log:
        with pytest.raises(ScenarioError, match=r"log: cannot write a security log: another run is writing to it$"):
            SecurityLog(path, router=False)
        log.note(3, "malformed")
    assert len(lines_of(path)) == 2


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full disk to write to")
def test_a_full_disk_ends_no_run_and_is_a_problem_of_its_result() -> None:
    tables = scenario(robots={"controller": "refused:NotANumber"})
    result = run(tables, runner="inline", security_log=Path("/dev/full"))
    assert result.refused
    assert result.problems == ["/dev/full: the security log is incomplete: No space left on device"]


# --- the command line -------------------------------------------------------------------------------------------------


def test_the_log_changes_no_result_and_an_honest_run_has_no_refusals(tmp_path: Path) -> None:
    command = ("run", "gossip-max", "--json", "--set", "robots.count=3", "--set", "time.duration_s=1")
    with_log, without = (zwerm(*command, *more, cwd=tmp_path) for more in (["--security-log", "log"], []))
    assert with_log.returncode == without.returncode == 0, with_log.stderr
    found, other = json.loads(with_log.stdout), json.loads(without.stdout)
    assert found["trace"] == other["trace"]
    assert found["refused"] == {"reasons": {}, "nodes": {}}
    assert [line["counts"] for line in lines_of(tmp_path / "log")] == [{}]


def test_intruders_are_counted_by_reason_and_node_in_the_result_and_the_log(tmp_path: Path) -> None:
    endpoint_address = ("127.0.0.1", free_port())
    endpoint, keys = f"tcp/127.0.0.1:{endpoint_address[1]}", tmp_path / "keys"
    settings = ("--set", "robots.count=3", "--set", "time.duration_s=1", "--json", "--security-log", "log")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    world = subprocess.Popen(
        [sys.executable, *ZWERM, "world", "gossip-max", "--listen", endpoint, "--credentials", str(keys), *settings],
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )

    def session(credential: Credential, place: str = endpoint) -> Any:
        return open_session(
            {
                "mode": "client",
                "id": credential.zid,
                "connect/endpoints": [place],
                "connect/timeout_ms": 1000,
                "connect/exit_on_failure": True,
                "transport/auth/usrpwd": {"user": credential.user, "password": credential.password},
            },
            "no session",
        )

    try:
        until(lambda: world.poll() is not None or (keys.exists() and keys.stat().st_size), "credentials written")
        credentials = load(keys)
        own, run_id = credentials.nodes[1], credentials.run
        for junk in (b"\xff" * 64, bytes(64), b"\x41" + b"\x31" * 63):  # no message, no handshake, another version
            with socket.create_connection(endpoint_address) as raw:
                raw.sendall(len(junk).to_bytes(2, "little") + junk)
                while raw.recv(64):  # until the router closes the connection
                    pass
        with pytest.raises(LinkError, match=r"^no session: "):
            session(msgspec.structs.replace(own, password="guess"))
        with FrameProxy(endpoint_address[1]) as proxy, session(own, proxy.endpoint) as stolen:
            stolen.put(command_key(run_id, 0), b"forged")
            until(lambda: proxy.frames, "a frame was captured")
        captured = proxy.message_with(b"forged")
        with (
            FrameProxy(endpoint_address[1]) as proxy,
            session(msgspec.structs.replace(own, zid="abc"), proxy.endpoint),
        ):
            with contextlib.suppress(OSError):  # the world has closed the connection
                for _ in range(FOREIGN):
                    proxy.send(*captured)
            until(lambda: proxy.ended, "the session was cut off")
        assert not replay(endpoint_address[1], proxy.handshake, fresh_cookie=False)
        with session(own) as intruder:
            intruder.put(command_key(run_id, 0), b"forged")
            intruder.put(command_key(run_id, 0), b"forged again")
            intruder.put(command_key(run_id, 1), bytes(3 << 20))
            intruder.put(command_key(run_id, 1), b"not joined")
        robots = zwerm("robot", "--connect", endpoint, "--credentials", str(keys), cwd=tmp_path)
        out, err = world.communicate(timeout=60)
    finally:
        world.kill()
        world.communicate()
    assert (world.returncode, robots.returncode) == (0, 0), (err, robots.stderr)
    refused = json.loads(out)["refused"]
    assert refused["nodes"]["1"] == {"denied": 3, "not-joined": 1}
    unknown = refused["nodes"].pop("unknown")
    assert unknown.pop("password") >= 1  # Zenoh tries again within the timeout of the session
    assert unknown.pop("denied", 0) <= FOREIGN
    assert unknown == {"cut-off": 1, "foreign-session": 1, "handshake": 4, "oversized": 1}
    *lines, last = lines_of(tmp_path / "log")
    assert last["counts"]["1"] == {"denied": 3, "not-joined": 1}
    denied = [line["detail"] for line in lines if line["reason"] == "denied" and line["node"] == 1]
    assert denied == [f"session {own.zid.lstrip('0')}: Put on {command_key(run_id, 0)}"] * 3


@pytest.mark.parametrize("log", [True, False])
def test_a_robot_that_floods_the_keys_of_another_is_ended_and_the_others_go_on(tmp_path: Path, log: bool) -> None:
    """Without a log the world looks for floods when the router is busy; here, as if it always were."""
    (tmp_path / "malicious.py").write_text((ROBOTS / "malicious.py").read_text())
    program = "from zwerm.run import denial_guard; denial_guard.WINDOW_S = 0.01; denial_guard.ANSWER_S_MAX = 0.0; "
    program += "denial_guard.CORE_FRACTION_MIN = 0.0; from zwerm.cli.app import main; main()"
    more = ("--set", "robots.controller=malicious:Trespasses", "--set", "robots.on_crash=continue")
    command = ("run", "computation-free", "--json", "--set", "robots.count=3", "--set", "time.duration_s=60", *more)
    ran = subprocess.run(
        [sys.executable, "-c", program, *command, *(["--security-log", "log"] if log else [])],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    found = json.loads(ran.stdout)
    assert (found["outcome"], found["ticks"], found["nodes"]["crashed"]) == ("time-limit", 600, [1])
    reason = found["nodes"]["reasons"]["1"]
    # On a busy machine its own flood may cut its connection before: then its program ends.
    assert "flood: 1000 of its operations were denied by the router" in reason or "exit code 3" in reason
    assert found["refused"]["nodes"]["1"]["denied"] > 0
