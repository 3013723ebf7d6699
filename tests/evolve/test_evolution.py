"""Evolution: the same result for any number of threads and after any interruption, its files, and Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import ROOT, ZWERM, scenario
from waiting import until

from zwerm.errors import ScenarioError
from zwerm.evolve.evolution import Evolution, EvolutionResult, EvolutionSettings
from zwerm.evolve.journal import Journal
from zwerm.scenario.tables import Scenario
from zwerm.study.study_tables import load_study
from zwerm.study.trial_plan import make_points

pytest.importorskip("numba", reason="the kernel is compiled by numba, which `make dev` installs")
pytest.importorskip("cmaes", reason="the search needs cmaes, which `make dev` installs")

DEADLINE_S = 120.0
SETTINGS = EvolutionSettings(runs=3, generations=4, population=4, trials=2, final_trials=3)
TABLES = """
[time]
dt_s = 0.1
duration_s = 5.0

[arena]
size_m = [1.0, 1.0]

[robots]
count = 3
controller = "computation-free"
body = { latency_ticks = 1 }
sensors = [{ kind = "line_of_sight" }]

[metrics]
cells = [2, 2]
"""


def covering() -> Scenario:
    return scenario(time={"duration_s": 5.0}, arena={"size_m": [1.0, 1.0]}, metrics={"cells": [2, 2]})


def evolved(path: Path, settings: EvolutionSettings = SETTINGS, jobs: int = 1) -> EvolutionResult:
    evolution = Evolution(covering(), settings)
    with Journal(path, evolution.identity()) as journal:
        result = evolution.run(journal, jobs)
    assert result is not None
    return result


def test_the_number_of_threads_changes_no_result_and_the_seed_does(tmp_path: Path) -> None:
    one = evolved(tmp_path / "one.jsonl")
    assert evolved(tmp_path / "two.jsonl", jobs=3) == one
    assert evolved(tmp_path / "other.jsonl", replace(SETTINGS, seed=2)) != one
    assert np.shape(one.fitness) == (3, 4)
    assert one.best_fitness == max(one.finals)
    assert all(-1.0 <= value <= 1.0 for value in one.parameters.values())


def test_an_evolution_continues_from_any_line_of_its_journal(tmp_path: Path) -> None:
    whole = tmp_path / "whole.jsonl"
    result = evolved(whole)
    lines = whole.read_bytes().splitlines(keepends=True)
    assert len(lines) == 1 + 3 * 4 + 3
    for kept in (1, 6, 14):
        part = tmp_path / f"{kept}.jsonl"
        part.write_bytes(b"".join(lines[:kept]) + lines[kept][:10])  # the process died while it wrote a line
        assert evolved(part) == result
        assert sorted(part.read_bytes().splitlines()) == sorted(whole.read_bytes().splitlines())


def test_more_runs_and_generations_go_on_from_the_journal(tmp_path: Path) -> None:
    journal = tmp_path / "j.jsonl"
    evolved(journal, replace(SETTINGS, runs=2, generations=3))
    held = journal.read_bytes()
    assert evolved(journal) == evolved(tmp_path / "anew.jsonl")
    assert journal.read_bytes().startswith(held)


def test_the_journal_of_other_settings_is_refused(tmp_path: Path) -> None:
    journal = tmp_path / "j.jsonl"
    evolved(journal)
    with pytest.raises(
        ScenarioError, match=r"j.jsonl: expected trials = 2, as in this file, got 5; --out names another"
    ):
        evolved(journal, replace(SETTINGS, trials=5))
    journal.write_text("no journal\n")
    with pytest.raises(ScenarioError, match=r"j.jsonl: expected the journal of an evolution"):
        evolved(journal)


def test_the_search_finds_better_controllers_than_it_starts_with(tmp_path: Path) -> None:
    spreading = scenario(
        time={"duration_s": 20.0},
        robots={
            "count": 12,
            "body": {"latency_ticks": 1},
            "placement": {"kind": "cell", "grid": [4, 4], "radius_m": 0.3},
        },
        metrics={"cells": [4, 4]},
    )
    evolution = Evolution(spreading, EvolutionSettings(1, 12, 8, 8, 20, seed=1))
    with Journal(tmp_path / "j.jsonl", evolution.identity()) as journal:
        result = evolution.run(journal)
    assert result is not None
    first, *_, last = result.fitness[0]
    assert last > 1.5 * first


def test_a_controller_without_bounds_is_refused() -> None:
    given = scenario(robots={"controller": "random-walk", "sensors": []}, metrics={"cells": [2, 2]})
    with pytest.raises(ScenarioError, match=r"robots.controller: expected one with two or more numbers"):
        Evolution(given, SETTINGS)


def start(folder: Path, *arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, *ZWERM, "evolve", "square.toml", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_ctrl_c_stops_the_command_and_the_same_command_goes_on(tmp_path: Path) -> None:
    (tmp_path / "square.toml").write_text(TABLES)
    few = ("--population", "4", "--trials", "2", "--final-trials", "2", "--jobs", "2")
    process = start(tmp_path, *few, "--runs", "2", "--generations", "100000")
    journal = tmp_path / "runs" / "square-evolved.jsonl"
    until(lambda: journal.exists() and journal.read_bytes().count(b"\n") > 5, "generations", DEADLINE_S)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, output) == (130, "")
    assert "zwerm: interrupted; the same command goes on from here" in errors
    assert "Traceback" not in errors

    held = journal.read_bytes()
    process = start(tmp_path, *few, "--runs", "2", "--generations", "3", "--json")
    output, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, errors
    assert journal.read_bytes().startswith(held)
    found = json.loads(output)
    assert len(found["fitness"]) == 2
    study = load_study(str(tmp_path / "runs" / "square-evolved.toml"))
    evolved_point, own = make_points(study)
    assert evolved_point.scenario.robots.parameters == found["parameters"]
    assert own.scenario.robots.parameters == {}
    assert (tmp_path / "runs" / "square-evolved.png").is_file()
