"""A failing schedule is reduced to the faults that it takes to fail, and written so that it can be run again."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import ROOT, ZWERM, scenario

from zwerm.errors import ScenarioError
from zwerm.run.runner import run
from zwerm.run.shrinking import Shrinker, parse_failing, tables_of, with_faults
from zwerm.scenario.load import load, validate
from zwerm.scenario.tables import Scenario
from zwerm.scenario.toml import write_toml

# Robot 4's id reaches 0 by way of 1 or of 2, and by no other.
POSES = [[1.0, 0.2, 0.0], [0.5, 1.0, 0.0], [1.5, 1.0, 0.0], [1.9, 0.2, 0.0], [1.0, 1.8, 0.0]]
PLANTED: list[dict[str, Any]] = [
    {"kind": "crash", "nodes": [1], "at_s": 0.1},
    {"kind": "jam", "center_m": [1.5, 1.0], "radius_m": 0.1, "at_s": 0.0},
]


def relay(faults: list[dict[str, Any]], **tables: Any) -> Scenario:
    robots = {
        "count": 5,
        "controller": "gossip-max",
        "parameters": {"done_at": 4},
        "sensors": [],
        "body": {"kind": "holonomic", "radius_m": 0.05},
        "placement": {"kind": "poses", "poses": POSES},
    }
    return scenario(robots=robots, radio={"range_m": 1.0}, faults=faults, time={"duration_s": 4.0}, **tables)


def harmless(count: int) -> list[dict[str, Any]]:
    """Return faults of every kind under which the largest id still reaches all robots."""
    kinds: list[dict[str, Any]] = [
        {"kind": "pause", "nodes": [0], "for_s": 0.3},
        {"kind": "slow", "nodes": [2], "every_ticks": 2, "for_s": 0.4},
        {"kind": "cut", "senders": [4], "receivers": [1], "for_s": 0.2},
        {"kind": "restart", "nodes": [3]},
        {"kind": "partition", "groups": [[3]], "for_s": 0.2},
        {"kind": "blackout", "for_s": 0.1},
    ]
    return [kinds[number % len(kinds)] | {"at_s": 0.05 * number} for number in range(count)]


def test_two_planted_faults_among_forty_are_found() -> None:
    others = harmless(40)
    faults = [*others[:13], PLANTED[0], *others[13:31], PLANTED[1], *others[31:]]
    shrinker = Shrinker(relay(faults), 1, parse_failing("robots_done_fraction < 0.8"))
    assert list(shrinker.shrink()) == PLANTED
    assert shrinker.tried < 100


def test_the_planted_faults_are_found_among_forty_random_ones_and_both_are_needed() -> None:
    random = {"seed": 3, "mean_s": 0.2, "pause_per_h": 12_000.0, "slow_per_h": 12_000.0, "cut_per_h": 12_000.0}
    chosen = relay(PLANTED, random_faults=random)
    assert len(run(chosen, 1, "inline").faults) > 40
    failing = parse_failing("robots_done_fraction < 0.8")
    found = Shrinker(chosen, 1, failing).shrink()
    assert list(found) == PLANTED
    for fault in PLANTED:
        assert not failing.of(run(relay([fault]), 1, "inline"))


def test_a_written_scenario_gives_the_same_run_again(tmp_path: Path) -> None:
    chosen = with_faults(relay(harmless(5)), PLANTED)
    written = tmp_path / "shrunk.toml"
    written.write_text(write_toml(tables_of(chosen)))
    assert run(written, 1, "inline").trace == run(chosen, 1, "inline").trace


@pytest.mark.parametrize(
    ("faults", "failing", "line"),
    [
        ([], "ticks > 0", "small.toml: faults: there are none to shrink"),
        (PLANTED, "ticks < 3", "small.toml: with seed 1 and all 2 faults the run does not fail"),
        (PLANTED, "ticks > 1", "small.toml: with seed 1 the run fails without any fault"),
    ],
)
def test_a_schedule_that_cannot_be_shrunk_is_refused_in_one_line(
    faults: list[dict[str, Any]], failing: str, line: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        Shrinker(relay(faults), 1, parse_failing(failing)).shrink()
    assert caught.value.mistakes == [line]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("bad", "--failing: expected a condition such as 'cell_coverage_fraction < 0.5', got 'bad'"),
        ("ticks < many", "--failing: expected a number after <, got 'many'"),
        ("outcome < failed", "--failing: an outcome is == or != another, got 'outcome < failed'"),
    ],
)
def test_an_invalid_condition_is_one_line(text: str, line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_failing(text)
    assert caught.value.mistakes == [line]


def test_an_unknown_metric_is_one_line_with_the_known_ones() -> None:
    with pytest.raises(ScenarioError, match=r"^--failing: expected one of outcome, robots_in_arena, .*, got coverage$"):
        Shrinker(relay(PLANTED), 1, parse_failing("coverage < 1")).shrink()


PLAIN = st.one_of(
    st.booleans(), st.integers(-(2**53), 2**53), st.floats(allow_nan=False), st.text(st.characters(codec="utf-8"))
)
TABLE = st.recursive(
    st.dictionaries(st.text(st.characters(codec="utf-8")), PLAIN, max_size=3),
    lambda inner: st.dictionaries(
        st.text(st.characters(codec="utf-8"), max_size=5),
        st.one_of(PLAIN, inner, st.lists(PLAIN, max_size=3), st.lists(inner, max_size=2)),
        max_size=3,
    ),
    max_leaves=8,
)


@settings(max_examples=25, deadline=None)
@given(TABLE)
def test_tomllib_reads_back_what_was_written(tables: dict[str, Any]) -> None:
    assert tomllib.loads(write_toml(tables)) == tables


def test_a_scenarios_tables_are_written_without_its_defaults() -> None:
    chosen = validate(
        {"name": "x", "arena": {"size_m": [1.0, 2.0]}, "robots": {"count": 1, "controller": "beacon"}}, "x", Path()
    )
    text = write_toml(tables_of(chosen))
    size = "size_m = [\n    1.0,\n    2.0,\n]"
    assert text == f'name = "x"\n\n[arena]\n{size}\n\n[robots]\ncount = 1\ncontroller = "beacon"\n'


def test_none_is_left_out_wherever_it_stands() -> None:
    tables = {"a": None, "b": {"c": None, "d": (1, None)}, "e": [{"f": None, "g": 1.0}, {}]}
    assert tomllib.loads(write_toml(tables)) == {"b": {"d": [1]}, "e": [{"g": 1.0}, {}]}


def command(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, *ZWERM, *arguments], cwd=folder, env=environment, capture_output=True, text=True, timeout=120
    )


def test_the_command_writes_the_smallest_schedule_as_a_scenario_that_still_fails(tmp_path: Path) -> None:
    (tmp_path / "big.toml").write_text(write_toml(tables_of(relay([*PLANTED, *harmless(4)]))))
    ran = command(tmp_path, "shrink", "big.toml", "--failing", "robots_done_fraction < 0.8", "--out", "least.toml")
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith("2 faults are enough, found in ")
    found = load(str(tmp_path / "least.toml"))
    assert [fault.model_dump() for fault in found.faults] == PLANTED
    assert run(found, 1, "inline").metrics["robots_done_fraction"] < 0.8
    none = command(tmp_path, "shrink", "least.toml", "--failing", "ticks < 3")
    assert none.returncode == 2
    assert none.stderr.strip() == "zwerm: least.toml: with seed 1 and all 2 faults the run does not fail"


def test_a_run_leaves_the_faults_that_it_drew_as_tables_that_run_again(tmp_path: Path) -> None:
    chosen = relay([], random_faults={"pause_per_h": 9_000.0, "cut_per_h": 9_000.0, "mean_s": 0.5})
    (tmp_path / "drawn.toml").write_text(write_toml(tables_of(chosen)))
    ran = command(tmp_path, "run", "drawn.toml", "--inline", "--seed", "4")
    assert ran.returncode == 0, ran.stderr
    faults = tomllib.loads((tmp_path / "runs" / "small-seed4-faults.toml").read_text())["faults"]
    assert len(faults) > 5
    assert run(relay(faults), 4, "inline").trace == run(chosen, 4, "inline").trace
