"""The tests carry out every instruction of the README without changes."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image
from support import ROOT

from zwerm.run.assembly import assemble
from zwerm.scenario.load import read, validate

README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.M | re.S)


def commands() -> list[str]:
    lines = [line.split("#")[0].strip() for block in blocks("sh") for line in block.splitlines()]
    return [line for line in lines if line]


@pytest.fixture
def desk(tmp_path: Path) -> Path:
    """A reader's folder, with the file that the README says to save, and `zwerm` on the PATH."""
    [own] = [block for block in blocks("python") if "class MyController" in block]
    (tmp_path / "my_file.py").write_text(own)
    (tmp_path / "bin").mkdir()
    launcher = tmp_path / "bin" / "zwerm"
    launcher.write_text(
        f"#!/bin/sh\nexec {shlex.quote(sys.executable)} -c 'from zwerm.cli.app import main; main()' \"$@\"\n"
    )
    launcher.chmod(0o755)
    return tmp_path


@pytest.mark.parametrize("command", [line for line in commands() if line.startswith("zwerm ")])
def test_a_command_of_the_readme_does_what_it_says(command: str, desk: Path) -> None:
    environment = os.environ | {"PATH": f"{desk / 'bin'}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    ran = subprocess.run(command, shell=True, cwd=desk, env=environment, capture_output=True, text=True, timeout=300)
    mistaken = "count=-1" in command
    assert ran.returncode == (2 if mistaken else 0), ran.stderr
    if mistaken:
        assert "robots.count: expected >= 1, got -1" in ran.stderr
    if "--picture-at 20s" in command:
        assert (desk / "runs/computation-free-seed1-20s.png").stat().st_size > 10_000
    if "--animate" in command:
        assert (desk / "swarm.gif").read_bytes().startswith(b"GIF8")


def test_the_readme_has_its_two_commands_and_they_are_targets() -> None:
    makes = [line for line in commands() if line.startswith("make ")]
    assert makes == ["make run", "make test"]
    for line in makes:
        subprocess.run([*line.split(), "--dry-run"], cwd=ROOT, check=True, capture_output=True, timeout=60)


@pytest.mark.skipif(
    not (ROOT / ".venv/.run-ready").exists(), reason="the environment of `make setup` is not what runs this"
)
def test_make_run_fills_the_hall_and_prints_the_path_of_the_picture() -> None:
    ran = subprocess.run(["make", "run"], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stderr
    picture = re.search(r"runs/\S+\.png", ran.stdout)
    assert picture is not None
    assert picture[0] == "runs/sensor-coverage-seed1.png"
    assert (ROOT / picture[0]).stat().st_size > 10_000
    assert re.search(r"^coverage_fraction +(1|0\.99\d*) ", ran.stdout, re.MULTILINE)
    assert "robots_deployed" in ran.stdout


def test_the_python_of_the_readme_runs(
    desk: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(desk)
    [script] = [block for block in blocks("python") if "zwerm.run(" in block]
    exec(compile(script, "README.md", "exec"), {"__name__": "readme"})
    assert capsys.readouterr().out.startswith("time-limit 0.")
    assert (desk / "computation-free.png").stat().st_size > 10_000


def test_the_toml_of_the_readme_is_a_valid_arena(desk: Path) -> None:
    (desk / "warehouse.yaml").write_text(
        "image: warehouse.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    Image.new("L", (100, 80), 254).save(desk / "warehouse.pgm")
    [table] = blocks("toml")
    (desk / "arena.toml").write_text(table)
    tables = (
        read(ROOT / "scenarios/computation_free/computation-free.toml")
        | read(desk / "arena.toml")
        | {"name": "warehouse"}
    )
    world = assemble(validate(tables, "warehouse.toml", desk), 1)
    assert world.scene.arena.area_m2 == pytest.approx(20.0)


def test_every_link_of_the_readme_leads_somewhere() -> None:
    for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
