"""A broken network is named within a stated time, however many robots it cuts off."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support import ROOT, ZWERM
from waiting import until

from zwerm.deploy.network.namespaces import Namespaces, address_of, unavailable_reason
from zwerm.errors import LinkError


def _unavailable() -> str:
    """Return why this machine can make no network namespaces, or ""."""
    reason = unavailable_reason()
    if "nft" not in reason:  # this test drops no single packets
        return reason
    try:
        with Namespaces([0]):
            return ""
    except LinkError as error:
        return str(error)


OUTAGE_S = 2.0
NAMED_WITHIN_S = OUTAGE_S + 5.0  # the promise of docs/concepts/security.md; the exit of the program comes on top
EXIT_S = 10.0
ROBOTS = 12


@pytest.mark.skipif(bool(_unavailable()), reason=_unavailable() or "this machine can make network namespaces")
def test_a_cut_cable_ends_a_run_of_many_robots_within_the_promised_time(tmp_path: Path) -> None:
    keys, record, endpoint = tmp_path / "robots.key", tmp_path / "run.mcap", f"tcp/{address_of(0)}:7447"
    with Namespaces([0, 1]) as networks:

        def start(node: int, *arguments: str) -> subprocess.Popen[str]:
            command = ["nsenter", f"--net={networks.path(node)}", sys.executable, *ZWERM, *arguments]
            environment = os.environ | {"PYTHONPATH": str(ROOT)}
            return subprocess.Popen(
                command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )

        world = start(
            0, "world", "computation-free", "--listen", endpoint, "--plain", "--credentials", str(keys), "--json",
            "--outage", str(OUTAGE_S), "--record", str(record),
            "--set", f"robots.count={ROBOTS}", "--set", "time.duration_s=1e6",
        )  # fmt: skip
        until(lambda: world.poll() is not None or (keys.exists() and keys.stat().st_size), "credentials written")
        robots = start(1, "robot", "--connect", endpoint, "--credentials", str(keys))
        try:
            until(
                lambda: world.poll() is not None or (record.exists() and record.stat().st_size > 50_000),
                "the run goes on",
            )
            networks.run(["ip", "link", "set", "node1", "down"])
            out, err = world.communicate(timeout=NAMED_WITHIN_S + EXIT_S)
            _, said = robots.communicate(timeout=NAMED_WITHIN_S + EXIT_S)
        finally:
            world.kill()
            robots.kill()
    assert world.returncode == 1, err
    result = json.loads(out)
    assert "crashed at tick" in err
    assert err.splitlines()[-1].endswith("the connection to it was lost")
    assert set(result["nodes"]["crashed"]) <= set(range(ROBOTS))
    assert robots.returncode == 1
    assert "ended with exit code 3" in said
