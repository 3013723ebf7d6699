"""The metadata of the package: where it says that its source is."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = ("pyproject.toml", "setup.py", "README.md", "LICENSE")


def metadata(folder: Path) -> list[str]:
    """Return the lines of the metadata that a build in `folder` writes."""
    command = [sys.executable, "setup.py", "--quiet", "egg_info"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return (folder / "zwerm.egg-info" / "PKG-INFO").read_text(encoding="utf-8").splitlines()


def source_tree(folder: Path, remote: str | None) -> Path:
    """Return a source tree without code in `folder`, as a repository with this remote, or without a repository."""
    for name in FILES:
        shutil.copy(ROOT / name, folder / name)
    if remote is not None:
        subprocess.run(["git", "init", "--quiet", folder], check=True)
        subprocess.run(["git", "-C", folder, "remote", "add", "origin", remote], check=True)
    return folder


@pytest.mark.parametrize(
    ("remote", "source"),
    [
        ("https://code.example.org/swarms/zwerm.git", "https://code.example.org/swarms/zwerm"),
        ("https://token@code.example.org/swarms/zwerm", "https://code.example.org/swarms/zwerm"),
        ("git@code.example.org:swarms/zwerm.git", "https://code.example.org/swarms/zwerm"),
        ("ssh://git@code.example.org:2222/swarms/zwerm.git", "https://code.example.org/swarms/zwerm"),
    ],
)
def test_a_package_names_the_host_that_its_source_tree_comes_from(tmp_path: Path, remote: str, source: str) -> None:
    lines = metadata(source_tree(tmp_path, remote))
    assert f"Project-URL: Source, {source}" in lines
    assert f"Project-URL: Issues, {source}/issues" in lines


@pytest.mark.parametrize("remote", [None, "/srv/zwerm", "../zwerm", "https://localhost/zwerm", "file:///srv/zwerm.git"])
def test_a_package_names_no_address_that_only_this_machine_knows(tmp_path: Path, remote: str | None) -> None:
    assert not [line for line in metadata(source_tree(tmp_path, remote)) if line.startswith("Project-URL")]


def test_a_package_built_from_a_source_archive_keeps_its_addresses(tmp_path: Path) -> None:
    first, second = tmp_path / "repository", tmp_path / "archive"
    first.mkdir()
    second.mkdir()
    lines = metadata(source_tree(first, "https://code.example.org/swarms/zwerm"))
    source_tree(second, None)
    (second / "PKG-INFO").write_text("\n".join(lines), encoding="utf-8")
    assert [line for line in metadata(second) if line.startswith("Project-URL")] == [
        line for line in lines if line.startswith("Project-URL")
    ]
