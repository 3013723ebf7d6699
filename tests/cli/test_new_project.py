"""`zwerm new`, `zwerm show`, `zwerm list` on one screen, and the completion of names by the shell."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

from command_line import zwerm
from support import ROOT, ZWERM

from zwerm.cli.project_files import FILES
from zwerm.scenario.load import built_in
from zwerm.study.study_tables import built_in as built_in_studies

# Lines and columns of a small window. There is room for some more scenarios.
SCREEN = (30, 80)


def test_a_new_project_runs_and_its_tests_pass(tmp_path: Path) -> None:
    made = zwerm("new", "my/swarm", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    project = tmp_path / "my" / "swarm"
    ran = zwerm("run", "scenario.toml", "--quiet", cwd=project)
    assert ran.returncode == 0, ran.stderr
    assert "spread" in ran.stdout
    environment = {"PYTHONPATH": str(ROOT), "PATH": os.environ["PATH"]}
    tests = subprocess.run(
        [sys.executable, "test_my_robot.py"], cwd=project, env=environment, capture_output=True, text=True, timeout=120
    )
    assert tests.stdout == "3 tests passed\n", tests.stderr
    study = zwerm("study", "study.toml", "--seeds", "1", "--jobs", "1", cwd=project)
    assert study.returncode == 0, study.stderr
    assert (project / "runs" / "loss.png").is_file()
    readme = (project / "README.md").read_text()
    assert FILES.keys() - {"README.md"} <= set(readme.replace("`", " ").split())


def test_the_folder_of_a_new_project_is_named_as_a_shell_takes_it(tmp_path: Path) -> None:
    made = zwerm("new", "my swärm", cwd=tmp_path)
    assert made.stdout.splitlines()[-1] == "cd 'my swärm', and look at README.md for what to run"


def test_new_overwrites_nothing(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("")
    refused = zwerm("new", ".", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr == "zwerm: .: expected a folder that does not exist, or is empty\n"
    assert zwerm("new", "mine/deeper", cwd=tmp_path).stderr.startswith("zwerm: mine/deeper: cannot be written: ")


def test_show_prints_a_file_as_it_is_and_its_path_to_standard_error() -> None:
    name = "gossip-max"
    shown = zwerm("show", name)
    assert shown.stdout == built_in()[name].read_text()
    assert shown.stderr == f"{built_in()[name]}\n"
    study = "computation-free-maze"
    assert (
        zwerm("show", "computation-free-comparison").stdout
        == built_in_studies()["computation-free-comparison"].read_text()
    )
    assert zwerm("show", study).stdout.startswith("summary")
    changed = zwerm("show", name, "--set", "radio.loss=0.3", "--set", "robots.count=4")
    tables = tomllib.loads(changed.stdout)
    assert (tables["radio"]["loss"], tables["robots"]["count"]) == (0.3, 4)
    assert zwerm("show", "gossip-mx").returncode == 2


def test_the_list_of_all_names_fits_a_screen() -> None:
    environment = {"PYTHONPATH": str(ROOT), "PATH": os.environ["PATH"], "COLUMNS": str(SCREEN[1])}
    ran = subprocess.run([sys.executable, *ZWERM, "list"], env=environment, capture_output=True, text=True, check=True)
    assert len(ran.stdout.splitlines()) <= SCREEN[0]
    assert set(built_in()) <= set(ran.stdout.split())


def test_the_shell_completes_commands_and_the_names_of_scenarios_and_studies() -> None:
    def completed(words: str, index: int) -> list[str]:
        environment = {"_ZWERM_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(index)}
        ran = subprocess.run(
            [sys.executable, "-c", "import sys; sys.argv[0] = 'zwerm'; from zwerm.cli.app import main; main()"],
            cwd=ROOT,
            env={"PYTHONPATH": str(ROOT), "PATH": os.environ["PATH"], **environment},
            capture_output=True,
            text=True,
        )
        return ran.stdout.split()

    assert completed("zwerm run goss", 2) == ["gossip-max"]
    assert completed("zwerm study computation-free-com", 2) == ["computation-free-comparison"]
    assert "compare" in completed("zwerm co", 1)
