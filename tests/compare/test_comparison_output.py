"""Whole comparisons: tables, figures, JSON, exit status."""

import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from comparisons import VARIANTS, planned
from matplotlib.figure import Figure
from rich.console import Console
from support import FONT_CACHE, ROOT, ZWERM

from zwerm.compare.comparison import Comparison, make_comparison
from zwerm.compare.comparison_figure import axis_label, draw_comparison
from zwerm.compare.comparison_report import print_comparison
from zwerm.compare.variants import parse_sweep, parse_variant
from zwerm.study.rows import read_rows
from zwerm.study.study_runner import run_study


def test_the_axis_label_of_a_loss_sweep_is_text_and_of_others_the_path() -> None:
    assert axis_label("radio.loss+uplink.loss") == axis_label("radio.loss") == "messages lost [fraction]"
    assert axis_label("faults.0.at_s") == "faults.0.at_s"
    assert axis_label("") == ""


def test_a_comparison_continues_and_gives_the_same_rows_in_processes_and_inline(gossip: Path, tmp_path: Path) -> None:
    study = planned(gossip, ("radio.loss=0.3",))
    inline = run_study(study, tmp_path / "inline.parquet", seeds=[1, 2], jobs=1)
    again = run_study(study, tmp_path / "inline.parquet", seeds=[1, 2, 3], jobs=1)
    assert (inline.ran, again.ran, again.done) == (4, 2, 6)
    run_study(study, tmp_path / "processes.parquet", seeds=[2], runner="processes")
    here, there = (
        {row["variant"]: row["trace"] for row in read_rows(tmp_path / f"{name}.parquet") if row["seed"] == 2}
        for name in ("inline", "processes")
    )
    assert here == there
    assert here["often"] != here["seldom"]


def test_each_value_of_a_second_sweep_has_its_own_figure(gossip: Path, tmp_path: Path) -> None:
    study = planned(gossip, ("radio.loss=0.0,0.5", "radio.range_m=0.8,1.0"))
    result = run_study(study, tmp_path / "out.parquet", seeds=[1, 2], jobs=1)
    for suffix, start in ((".png", b"\x89PNG"), (".pdf", b"%PDF")):
        drawn = draw_comparison(tmp_path / f"figure{suffix}", Comparison(result.results))
        assert [path.name for path in drawn] == [f"figure-radio.range_m={each}{suffix}" for each in (0.8, 1.0)]
        assert all(path.read_bytes().startswith(start) for path in drawn)


def test_a_line_connects_values_in_ascending_order(gossip: Path, tmp_path: Path) -> None:
    drawn: list[Any] = []
    for sweep in ("radio.loss=0.0,0.3,0.6", "radio.loss=0.3,0.6,0.0"):
        result = run_study(planned(gossip, (sweep,)), tmp_path / "out.parquet", seeds=[1], jobs=1)
        drawn += draw_comparison(tmp_path / f"{len(drawn)}.png", Comparison(result.results))
    assert drawn[0].read_bytes() == drawn[1].read_bytes()


def marker_places(gossip: Path, tmp_path: Path, sweep: str, monkeypatch: pytest.MonkeyPatch) -> list[list[float]]:
    """Draw a comparison over `sweep`, and return the x of every variant's markers in the first panel."""
    figures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **_: figures.append(figure))
    result = run_study(planned(gossip, (sweep,)), tmp_path / "out.parquet", seeds=[1], jobs=1)
    draw_comparison(tmp_path / "figure.png", Comparison(result.results))
    return [list(map(float, each[0].get_xdata())) for each in figures[0].axes[0].containers]


def test_no_words_of_a_figure_are_cut_off(gossip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **_: figures.append(figure))
    names = [
        f"{name}-with-a-long-name:{settings}" for name in "abcdef" for settings in ["robots.parameters.every_ticks=5"]
    ]
    study = make_comparison(str(gossip), [parse_variant(each) for each in names], [])
    result = run_study(study, tmp_path / "out.parquet", seeds=[1], jobs=1)
    draw_comparison(tmp_path / "figure.png", Comparison(result.results), ["ticks"])
    (figure,) = figures
    figure.draw_without_rendering()
    words = [*figure.texts, *figure.legends[0].get_texts()]
    boxes = [each.get_window_extent() for each in words]
    assert len(boxes) == 2 + len(names)
    assert all(figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 for box in boxes)
    assert min(box.y0 for box in boxes) >= max(axes.get_tightbbox().y1 for axes in figure.axes)


def test_markers_stand_at_the_values_of_a_sweep(gossip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert marker_places(gossip, tmp_path, "radio.loss=0.0,0.5", monkeypatch) == [[0.0, 0.5], [0.0, 0.5]]
    named = marker_places(gossip, tmp_path, "radio.models=few:[],many:[{kind='loss',fraction=0.5}]", monkeypatch)
    assert named[0] != named[1]


@pytest.mark.parametrize("width", [80, 140])
def test_comparison_tables_fit_the_width_of_the_terminal(gossip: Path, tmp_path: Path, width: int) -> None:
    variants = [parse_variant(each) for each in ("as-it-is", "decentralised-seldom:robots.parameters.every_ticks=5")]
    sweeps = [parse_sweep("radio.loss+robots.body.radius_m=0.05,0.1"), parse_sweep("robots.parameters.done_at=9")]
    study = make_comparison(str(gossip), variants, sweeps, metrics=["messages_per_robot_mean"])
    comparison = Comparison(run_study(study, tmp_path / "out.parquet", seeds=[1, 2], jobs=1).results)
    console = Console(width=width, record=True, file=io.StringIO())
    print_comparison(console, comparison)
    lines = console.export_text().splitlines()
    assert max(map(len, lines)) <= width
    words = [line.split() for line in lines]
    # Names are in one piece, or broken at their joints, and so are values.
    for name in ("radio.loss", "+robots.body.radius_m", "as-it-is", "decentralised-seldom"):
        assert sum(name in line for line in words) >= 2, name
    rows = [line for line in words if line[:1] in (["0.05"], ["0.1"])]
    assert {tuple(line[:2]) for line in rows} == {("0.05", "9"), ("0.1", "9")}
    assert sum(line.count("±") for line in rows) == 2 * 3, "two means and a difference at each of two places"


def zwerm(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "COLUMNS": "140", "HOME": str(cwd)}
    environment["MPLCONFIGDIR"] = FONT_CACHE
    return subprocess.run(
        [sys.executable, *ZWERM, *arguments], cwd=cwd, env=environment, capture_output=True, text=True, timeout=120
    )


def test_compare_prints_tables_and_draws_a_figure_or_prints_one_json_object(gossip: Path, tmp_path: Path) -> None:
    command = ["compare", "talk.toml", "--seeds", "2", "--jobs", "1", "--sweep", "radio.loss=0.0,0.5"]
    command += [word for each in VARIANTS for word in ("--variant", each)]
    ran = zwerm(*command, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "seldom against often" in ran.stdout
    assert "outcomes" in ran.stdout
    assert "seldom - often" in ran.stdout
    assert "8 of 8 trials, 8 of them run now: runs/compare-talk.parquet" in ran.stderr
    assert (tmp_path / "runs/compare-talk.png").read_bytes().startswith(b"\x89PNG")

    ran = zwerm(*command, "--json", cwd=tmp_path)
    assert (ran.returncode, ran.stderr) == (0, "")
    found = json.loads(ran.stdout)
    assert (found["planned"], found["done"], found["ran"]) == (8, 8, 0)
    assert found["variants"] == ["often", "seldom"]
    assert [(point["variant"], point["settings"]["radio.loss"]) for point in found["points"]] == [
        ("often", 0.0), ("seldom", 0.0), ("often", 0.5), ("seldom", 0.5),
    ]  # fmt: skip
    often, seldom = found["points"][:2]
    messages = "messages_per_robot_mean"
    difference = seldom["metrics"][messages]["mean"] - often["metrics"][messages]["mean"]
    assert seldom["differences"][messages]["mean"] == pytest.approx(difference)
    assert seldom["against"] == "often"
    assert sum(often["outcomes"].values()) == 2


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--variant", "a", "--variant", "b:radio.lost=1"], "compare: b: talk.toml: radio.lost: unknown key"),
        (["--variant", "a", "--variant", "b", "--sweep", "radio.loss=2"], "radio.loss: expected <= 1, got 2"),
        (["--variants", "nothing.toml"], "nothing.toml: expected a study's file or the name of a built-in one"),
    ],
)
def test_an_input_error_of_compare_is_one_line_and_status_2(
    gossip: Path, tmp_path: Path, arguments: list[str], line: str
) -> None:
    ran = zwerm("compare", "talk.toml", *arguments, cwd=tmp_path)
    assert ran.returncode == 2
    assert line in ran.stderr
    assert len(ran.stderr.splitlines()) <= 2
    assert ran.stdout == ""


def test_study_with_json_prints_one_object(gossip: Path, tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(
        'scenario = "talk.toml"\nseeds = 2\nmetrics = ["delivered_fraction", "telemetry.nothing"]\n'
        "[[paper.points]]\nvalues = { delivered_fraction = { at_least = 0.01 } }\n"
    )
    ran = zwerm("study", "study.toml", "--jobs", "1", "--json", cwd=tmp_path)
    assert (ran.returncode, ran.stderr) == (0, "")
    [point] = json.loads(ran.stdout)["points"]
    assert point["metrics"]["delivered_fraction"]["n"] == 2
    assert point["metrics"]["delivered_fraction"]["paper_is_bound"] is True
    assert point["metrics"]["telemetry.nothing"] == {"n": 0, "mean": None, "sd": None, "half_width": None}
