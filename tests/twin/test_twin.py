"""The twin: packets between robots cross a real network with the rules of the models; nothing remains afterwards."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from support import ROOT, ZWERM, children_of, gone, scenario
from waiting import until

from zwerm.deploy.network.impairments import supported
from zwerm.deploy.network.namespaces import Namespaces, netem_unavailable_reason, unavailable_reason
from zwerm.errors import LinkError
from zwerm.link.peer_radio import ARRIVED
from zwerm.scenario.tables import Scenario
from zwerm.twin import twin_runner as running
from zwerm.twin.packet_comparison import compare, lost_runs
from zwerm.twin.twin_runner import run_twin

WHY_NOT = unavailable_reason()
on_a_real_network = pytest.mark.skipif(bool(WHY_NOT), reason=f"the twin on a real network {WHY_NOT}")

# A square, 2 m wide.
POSES = [[1.0, 1.0, 0.0], [3.0, 1.0, 0.0], [3.0, 3.0, 0.0], [1.0, 3.0, 0.0]]
LINKS = [(a, b) for a in range(4) for b in range(4) if a != b]


def beacons(dt_s: float, duration_s: float, **tables: Any) -> Scenario:
    robots = {
        "count": 4,
        "controller": "beacon",
        "sensors": [],
        "body": {"kind": "holonomic"},
        "placement": {"kind": "poses", "poses": POSES},
    }
    base = {"time": {"dt_s": dt_s, "duration_s": duration_s}, "arena": {"size_m": [4.0, 4.0]}, "robots": robots}
    return scenario(**{**base, "radio": {}, **tables})


def by_link(found: dict[str, Any], column: str) -> dict[tuple[int, int], int]:
    links = found["links"]
    return dict(zip(zip(links["sender"], links["receiver"], strict=True), links[column], strict=True))


# --- the same losses ------------------------------------------------------------------------------------------------


@on_a_real_network
def test_over_udp_a_real_network_loses_what_the_models_lose(nothing_left: None) -> None:
    models = [
        {"kind": "loss", "fraction": 1.0, "senders": [0], "receivers": [1]},
        {"kind": "loss", "fraction": 0.3, "senders": [1]},
        {"kind": "gilbert_elliott", "loss_fraction": 0.4, "burst_packets": 6.0, "senders": [2, 3]},
    ]
    run = run_twin(beacons(0.01, 2.5, radio={"models": models}), 1, "udp")
    found = compare(run)
    assert found["outcome"] == "time-limit"
    assert found["middleware_lost"] == 0
    sent, passed = by_link(found, "sent"), by_link(found, "passed")
    assert sent == dict.fromkeys(LINKS, 250)
    assert passed[0, 1] == 0, "a one-way link stays one-way"
    assert passed[0, 2] == passed[0, 3] == 250, "where no model stands in the way nothing is lost"
    assert passed[1, 0] > 125
    # Twice the half width of 99 %: a network's chances have no seed.
    assert abs(found["difference"]) < 2.0 * found["half_width"]
    independent = sum(passed[1, other] for other in (0, 2, 3)) / 750
    assert abs(independent - 0.7) < 5.0 * (0.7 * 0.3 / 750) ** 0.5
    numbers: dict[tuple[int, int], list[int]] = {link: [] for link in LINKS}
    for receiver, lines in run.logs.items():
        for line in lines:
            if line.what == ARRIVED:
                numbers[line.other, receiver].append(line.number)
    lengths = [length for a, b in LINKS if a in (2, 3) for length in lost_runs(list(range(250)), set(numbers[a, b]))]
    assert abs(sum(lengths) / len(lengths) - 6.0) < 5.0 * (6.0 * 5.0 / len(lengths)) ** 0.5


@on_a_real_network
def test_pairs_out_of_range_or_cut_by_a_fault_are_blocked_at_each_tick(nothing_left: None) -> None:
    faults = [
        {"kind": "partition", "groups": [[0, 1]], "at_s": 0.6, "for_s": 0.5},
        {"kind": "cut", "senders": [2], "receivers": [3], "at_s": 0.3, "for_s": 0.5},
    ]
    wall = {"size_m": [4.0, 4.0], "walls": [[[2.0, 0.0], [2.0, 2.0]]]}
    chosen = beacons(0.1, 1.5, radio={"range_m": 2.5, "line_of_sight": True}, faults=faults, arena=wall)
    found = compare(run_twin(chosen, 1, "udp"))
    modelled, passed = by_link(found, "modelled_passed"), by_link(found, "passed")
    near = {(0, 3): 10, (3, 0): 10, (1, 2): 10, (2, 1): 10, (2, 3): 10, (3, 2): 15}
    assert modelled == {link: near.get(link, 0) for link in LINKS}
    for link in LINKS:
        # A robot that answers a tick late meets the network of the next one.
        assert abs(passed[link] - modelled[link]) <= found["late_commands"], link


@on_a_real_network
def test_the_uplink_has_its_own_rules_between_robots_and_coordinator(nothing_left: None) -> None:
    robots = {"count": 2, "controller": "radioed:Counts", "sensors": [], "body": {"kind": "holonomic"}}
    deaf = {"kind": "loss", "fraction": 1.0, "senders": [0], "receivers": ["coordinator"]}
    chosen = scenario(
        time={"duration_s": 1.0},
        robots=robots,
        radio={"loss": 1.0},
        uplink={"models": [deaf]},
        coordinator={"controller": "radioed:Counts"},
    )
    found = compare(run_twin(chosen, 1, "udp"))
    links = found["links"]
    passed = dict(
        zip(zip(links["channel"], links["sender"], links["receiver"], strict=True), links["passed"], strict=True)
    )
    nothing = {("robots", 0, 1): 0, ("robots", 1, 0): 0, ("uplink", 0, 2): 0}
    assert passed == nothing | {("uplink", 1, 2): 10, ("uplink", 2, 0): 10, ("uplink", 2, 1): 10}


@on_a_real_network
def test_over_tcp_loss_becomes_delay_and_retransmission(nothing_left: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(running.DRAIN_S, "tcp", 4.0)  # a segment that is lost four times takes 3 s
    chosen = beacons(0.02, 2.0, radio={"loss": 0.1})
    found = compare(run_twin(chosen, 1, "tcp"))
    assert found["modelled"]["passed_fraction"] < 0.95
    assert found["real"]["passed_fraction"] > 0.98
    assert not found["agrees"]
    assert found["real"]["tcp_segments_sent_again"] > 20
    assert found["real"]["delay_s"]["max"] > 0.2, "the least that TCP waits before it sends again"
    assert found["real"]["heard_after_mean_s"] > found["modelled"]["heard_after_mean_s"]


@on_a_real_network
def test_a_rate_limit_is_a_token_bucket_at_the_sender(nothing_left: None) -> None:
    limit = {"kind": "rate_limit", "rate_bytes_s": 400.0, "queue_bytes": 64.0, "senders": [0, 1]}
    found = compare(run_twin(beacons(0.02, 2.0, radio={"models": [limit]}), 1, "udp"))
    sent, passed, modelled = (by_link(found, column) for column in ("sent", "passed", "modelled_passed"))
    for sender, receiver in LINKS:
        if sender >= 2:
            assert passed[sender, receiver] == sent[sender, receiver]
    slowed, expected = (sum(column[link] for link in LINKS if link[0] < 2) for column in (passed, modelled))
    assert expected < 0.6 * 600
    assert abs(slowed - expected) < 0.15 * expected


@on_a_real_network
def test_a_delay_uses_netem_or_is_skipped_on_both_sides_with_its_reason(nothing_left: None) -> None:
    delay = {"kind": "delay", "delay_s": 0.1, "jitter_s": 0.02}
    chosen, skipped = supported(beacons(0.05, 1.0, radio={"models": [delay]}))
    reason = netem_unavailable_reason()
    assert skipped == ([f"radio.models.0 (delay): {reason}"] if reason else [])
    found = compare(run_twin(chosen, 1, "udp"))
    expected_s = 0.0 if reason else 0.12
    assert found["real"]["delay_s"]["median"] >= expected_s
    assert found["modelled"]["heard_after_mean_s"] == pytest.approx(0.05 if reason else 0.15, abs=0.03)


# --- nothing is left ------------------------------------------------------------------------------------------------


def networks(pids: Iterable[int] | None = None) -> set[str]:
    """Return the network namespaces that some of these processes stand in or hold open, or any process at all."""
    found = set()
    for pid in [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()] if pids is None else pids:
        entry = Path("/proc") / str(pid)
        try:
            names = [str(link.readlink()) for link in (entry / "ns" / "net", *(entry / "fd").iterdir())]
        except OSError:
            continue
        found |= {name for name in names if name.startswith("net:")}
    return found - {str(Path("/proc/self/ns/net").readlink())}


def descendants(pid: int) -> set[int]:
    children = children_of(pid)
    return children.union(*(descendants(child) for child in children))


@on_a_real_network
@pytest.mark.parametrize(
    ("target", "number", "status"),
    [("itself", signal.SIGINT, 130), ("itself", signal.SIGKILL, -9), ("robot", signal.SIGKILL, 1)],
)
def test_no_namespace_or_process_remains_after_an_interrupted_or_killed_twin(
    target: str, number: signal.Signals, status: int, private_tmp: Path
) -> None:
    interfaces = sorted(Path("/sys/class/net").iterdir())
    command = [
        sys.executable,
        *ZWERM,
        "twin",
        "beacon-twin",
        "--transport",
        "udp",
        "--json",
        "--set",
        "time.duration_s=600",
    ]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        until(
            lambda: (
                len(logs := list(private_tmp.glob("zwerm-*/radio-*"))) == 4
                and all(log.stat().st_size > 1_000 for log in logs)
            ),
            "robots send",
            90.0,
        )
        robots = {pid for pid in descendants(process.pid) if not children_of(pid)}
        started = {process.pid, *descendants(process.pid)}
        own = networks(started)
        assert len(own) == 5, "one for each robot, and the bridge's"
        running_robots = [pid for pid in robots if str(Path(f"/proc/{pid}/ns/net").readlink()) in own]
        assert len(running_robots) == 4
        os.kill(process.pid if target == "itself" else running_robots[0], number)
        _, complaints = process.communicate(timeout=60.0)
    assert process.returncode == status, complaints
    until(lambda: gone(started), "all processes end")
    until(lambda: not own & networks(), "all namespaces vanish")
    assert sorted(Path("/sys/class/net").iterdir()) == interfaces


@on_a_real_network
def test_namespaces_are_removed_after_an_error(nothing_left: None) -> None:
    before = networks([os.getpid()])
    with pytest.raises(LinkError, match=r"^nft -f -: .*syntax error"), Namespaces([0, 1]) as there:
        there.run(["nft", "-f", "-"], "nonsense\n")
    assert networks([os.getpid()]) == before


def test_the_reason_for_an_unavailable_network_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert unavailable_reason() == "needs root, to make network namespaces"
    monkeypatch.setattr(sys, "platform", "darwin")
    assert unavailable_reason() == "needs Linux, this is darwin"
    with pytest.raises(LinkError, match=r"^the twin on a real network needs Linux, this is darwin$"):
        run_twin(scenario(radio={}), 1, "udp")


@on_a_real_network
def test_twin_prints_one_json_object_and_a_missing_tool_is_an_input_error(private_tmp: Path) -> None:
    command = [sys.executable, *ZWERM, "twin", "beacon-twin", "--transport", "udp", "--json"]
    short = ["--set", "time.duration_s=0.5"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([*command, *short], env=environment, capture_output=True, check=False)
    found = json.loads(done.stdout)
    assert (done.returncode, found["skipped"]) == (0, [])
    assert found["transports"]["udp"]["modelled"]["sent"] == found["transports"]["udp"]["real"]["sent"] == 10 * 12
    bare = subprocess.run(
        [*command, *short], env=environment | {"PATH": ""}, capture_output=True, text=True, check=False
    )
    assert bare.returncode == 2
    assert bare.stderr == "zwerm: the twin on a real network needs the command ip, from the package iproute2\n"
