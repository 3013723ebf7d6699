"""The manifests of one run over several hosts: valid by their schemas, and their commands make a run."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from network import free_port
from support import ROOT

MANIFESTS = ROOT / "deploy" / "manifests"
DEADLINE_S = 90.0


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """An environment in which `zwerm`, `srun` and `scontrol` are commands; all hosts are this machine."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name, text in (
        ("zwerm", f'exec "{sys.executable}" -c "from zwerm.cli.app import main; main()" "$@"'),
        ("scontrol", "printf 'localhost\\nfirst\\nsecond\\n'"),
        ("srun", 'while [ "${1#--}" != "$1" ]; do shift; done; exec "$@"'),
    ):
        (folder / name).write_text(f"#!/bin/sh\n{text}\n")
        (folder / name).chmod(0o755)
    path = os.pathsep.join([str(folder), os.environ["PATH"]])
    return os.environ | {"PYTHONPATH": str(ROOT), "PATH": path, "TMPDIR": "/tmp"}


def commands() -> Iterator[tuple[str, list[str]]]:
    """Yield the name of a manifest and the command of each of its containers."""
    compose = yaml.safe_load((MANIFESTS / "run-compose.yaml").read_text())
    for service in compose["services"].values():
        yield "compose", service["command"]
    for document in yaml.safe_load_all((MANIFESTS / "run-kubernetes.yaml").read_text()):
        if document["kind"] == "Job":
            (container,) = document["spec"]["template"]["spec"]["containers"]
            yield "kubernetes", container["command"]


def test_the_slurm_job_runs_a_scenario_over_its_hosts_and_removes_the_keys(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    job = {"SLURM_JOB_ID": "7", "SLURM_JOB_NODELIST": "x", "SCENARIO": "gossip-max", "NODES": "25"}
    ran = subprocess.run(
        ["bash", str(MANIFESTS / "run.slurm")],
        cwd=tmp_path,
        env=environment | job | {"PORT": str(free_port())},
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
    )
    assert ran.returncode == 0, ran.stderr
    result = json.loads((tmp_path / "zwerm-run-7.json").read_text())
    assert (result["outcome"], result["runner"], result["robots"]) == ("completed", "remote", 25)
    assert [path.name for path in tmp_path.iterdir() if "keys" in path.name] == []


def test_the_commands_of_the_containers_make_one_run(tmp_path: Path, environment: dict[str, str]) -> None:
    port = str(free_port())

    def local(words: list[str]) -> list[str]:
        return [
            word.replace("zwerm-world:", "localhost:").replace("/world:", "/localhost:").replace("7447", port)
            for word in (each.replace("/keys/", "keys/") for each in words)
        ]

    made = [
        "zwerm",
        "keys",
        "gossip-max",
        "keys",
        "--name",
        "localhost",
        "--host",
        "left=0-12",
        "--host",
        "right=13-24",
    ]
    subprocess.run(made, cwd=tmp_path, env=environment, check=True, capture_output=True, timeout=DEADLINE_S)
    pieces = [
        subprocess.Popen(
            local(words), cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for kind, words in commands()
        if kind == "kubernetes"
    ]
    try:
        said = [each.communicate(timeout=DEADLINE_S) for each in pieces]
    finally:
        for each in pieces:
            each.kill()
            each.communicate()
    assert [each.returncode for each in pieces] == [0, 0, 0], said
    assert json.loads(said[0][0])["outcome"] == "completed"


def test_compose_and_kubernetes_run_the_same_commands() -> None:
    found = {kind: [words for each, words in commands() if each == kind] for kind in ("compose", "kubernetes")}
    renamed = [[word.replace("tls/zwerm-world:", "tls/world:") for word in words] for words in found["kubernetes"]]
    assert found["compose"] == renamed


@pytest.mark.skipif(
    subprocess.run(["docker", "compose", "version"], capture_output=True, check=False).returncode != 0
    if shutil.which("docker")
    else True,
    reason="Docker Compose is not installed",
)
@pytest.mark.parametrize("name", ["run-compose.yaml", "cluster-compose.yaml"])
def test_compose_takes_the_manifest(name: str) -> None:
    command = ["docker", "compose", "-f", str(MANIFESTS / name), "--project-directory", str(ROOT), "config", "--quiet"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr


def test_kubernetes_takes_the_manifest_by_the_schema_of_its_api() -> None:
    validate: Any = pytest.importorskip("kubernetes_validate", reason="`make dev` installs the schemas")
    for document in yaml.safe_load_all((MANIFESTS / "run-kubernetes.yaml").read_text()):
        validate.validate(document, validate.latest_version(), strict=True)


def test_each_container_holds_the_keys_of_its_own_host_only() -> None:
    compose = yaml.safe_load((MANIFESTS / "run-compose.yaml").read_text())
    for name, service in compose["services"].items():
        assert service["volumes"] == [f"./keys/{name}.key:/keys/{name}.key:ro"]
    for document in yaml.safe_load_all((MANIFESTS / "run-kubernetes.yaml").read_text()):
        if document["kind"] == "Job":
            (volume,) = document["spec"]["template"]["spec"]["volumes"]
            assert volume["secret"] == {"secretName": document["metadata"]["name"], "defaultMode": 0o400}
