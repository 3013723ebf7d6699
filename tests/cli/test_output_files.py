"""Files that commands write: checked before the work, all of them named, none overwritten by another run."""

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import zwerm
from support import ROOT

from zwerm.cli.output_files import ANIMATIONS, PICTURES, OutputFile, check_outputs, run_stem
from zwerm.errors import ScenarioError

SHORT = ("run", "computation-free", "--inline", "--quiet", "--set", "time.duration_s=0.3")


def mistakes_of(*files: OutputFile) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        check_outputs(files)
    return caught.value.mistakes


def test_every_file_that_cannot_be_written_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.png").mkdir()
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert mistakes_of(
        OutputFile("--picture", tmp_path / "a.jpg", PICTURES),
        OutputFile("--picture", tmp_path / "folder.png", PICTURES),
        OutputFile("--animate", tmp_path / "file" / "a.gif", ANIMATIONS),
        OutputFile("--animate", tmp_path / "a.mp4", ANIMATIONS),
        OutputFile("--record", tmp_path / "a.mcap", (".mcap",), "no_such_package", "record"),
    ) == [
        f"--picture: {tmp_path}/a.jpg: expected a file that ends in .png or .pdf or .svg",
        f"--picture: {tmp_path}/folder.png: is a folder",
        f"--animate: {tmp_path}/file/a.gif: {tmp_path}/file is no folder",
        f"--animate: {tmp_path}/a.mp4: an .mp4 needs ffmpeg, which is not installed; choose a .gif",
        f"--record: {tmp_path}/a.mcap: needs no_such_package: pip install 'zwerm[record]'",
    ]
    check_outputs(
        [OutputFile("--picture", tmp_path / "new" / "a.PNG", PICTURES), OutputFile("--animate", None, ANIMATIONS)]
    )
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("size", ["0x3", "0.01x3", "3x51", "99999x99999", "3", "ax3", "9" * 400 + "x3"])
def test_a_size_that_cannot_be_drawn_is_refused_before_the_run(tmp_path: Path, size: str) -> None:
    ran = zwerm(*SHORT, "--size", size, cwd=tmp_path)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith(
        "zwerm: --size: expected WIDTHxHEIGHT in inches, such as 3.4x3, each from 0.5 to 50, got "
    )
    assert len(ran.stderr.splitlines()) == 1


def test_files_are_checked_before_the_run_and_all_at_once(tmp_path: Path) -> None:
    ran = zwerm(*SHORT, "--picture", "a.txt", "--record", "b.bag", "--picture-at", "soon", cwd=tmp_path)
    assert ran.returncode == 2
    assert ran.stdout == ""
    assert [line.split(": ")[1] for line in ran.stderr.splitlines()] == ["--picture-at", "--picture", "--record"]
    assert list(tmp_path.iterdir()) == []


def test_a_picture_after_the_end_of_the_run_is_refused_before_it(tmp_path: Path) -> None:
    ran = zwerm(*SHORT, "--picture-at", "0.2s", "--picture-at", "99s", cwd=tmp_path)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr == "zwerm: --picture-at: expected a time of the run, 0 to 0.3 s, got 99s\n"


def test_the_table_names_every_file_and_settings_are_part_of_names(tmp_path: Path) -> None:
    ran = zwerm(*SHORT, "--record", "r.mcap", "--animate", "a.gif", "--set", "robots.count=3", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    rows = dict(line.split(": ", 1) for line in ran.stdout.splitlines() if line.count(": ") == 1)
    assert rows["recording"].strip() == "r.mcap"
    assert rows["animation"].strip() == "a.gif"
    assert rows["picture"].strip() == "runs/computation-free-seed1-time.duration_s=0.3-robots.count=3.png"
    assert all((tmp_path / rows[kind].strip()).is_file() for kind in ("recording", "animation", "picture"))


def test_the_name_of_a_run_has_its_settings_and_long_ones_a_digest() -> None:
    assert run_stem("s", 2) == "s-seed2"
    assert run_stem("s", 2, ["radio.models=[{kind='loss'}]", "a=b/c"]) == "s-seed2-radio.models=-kind=-loss-a=b-c"
    long = [run_stem("s", 1, ["a=" + 90 * "x" + end]) for end in "12"]
    assert long[0] != long[1]
    assert all(len(each) < 120 for each in long)


def test_without_matplotlib_the_result_is_printed_and_then_a_hint(tmp_path: Path) -> None:
    hidden = "import sys; sys.modules['matplotlib'] = None; from zwerm.cli.app import main; main()"
    for more, status in (((), 0), (("--picture", "a.png"), 2)):
        ran = subprocess.run(
            [sys.executable, "-c", hidden, *SHORT, *more],
            cwd=tmp_path,
            env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
            capture_output=True,
            text=True,
        )
        assert ran.returncode == status
        if more:
            assert ran.stderr == "zwerm: --picture: a.png: needs matplotlib: pip install 'zwerm[all]'\n"
        else:
            assert "trace " in ran.stdout
            assert ran.stderr == "no picture is drawn: matplotlib is not installed; pip install matplotlib\n"


def test_a_study_writes_its_rows_as_csv_too(tmp_path: Path) -> None:
    study = 'scenario = "computation-free"\nset = ["time.duration_s=0.3"]\nseeds = 2\nmetrics = ["area_coverage_fraction"]\n'
    (tmp_path / "small.toml").write_text(study)
    ran = zwerm("study", "small.toml", "--jobs", "1", "--out", "rows.csv", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "rows as CSV: rows.csv" in ran.stderr
    with (tmp_path / "rows.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["seed"] for row in rows] == ["1", "2"]
    assert float(rows[0]["area_coverage_fraction"]) > 0.0
    assert len(json.loads(rows[0]["cell_counts"])) == 25
    again = zwerm("study", "small.toml", "--jobs", "1", "--out", "rows.csv", "--json", cwd=tmp_path)
    assert json.loads(again.stdout)["ran"] == 0
    assert zwerm("study", "small.toml", "--out", "rows.xls", cwd=tmp_path).stderr == (
        "zwerm: --out: rows.xls: expected a file that ends in .parquet or .csv\n"
    )
