"""Variants, sweeps and points of a comparison."""

from pathlib import Path

import pytest
from comparisons import planned

from zwerm.compare.comparison import make_comparison
from zwerm.compare.variants import parse_sweep, parse_variant
from zwerm.errors import ScenarioError
from zwerm.study.study_tables import load_study
from zwerm.study.trial_plan import make_points


def test_a_variant_argument_is_a_name_and_its_settings() -> None:
    assert parse_variant("central").set == []
    both = parse_variant("gradient:services.path=gradient, services.redundancy=link")
    assert (both.name, both.set) == ("gradient", ["services.path=gradient", "services.redundancy=link"])
    nested = parse_variant("a:arena.size_m=[1, 2],robots.body={kind='x', radius_m=1},name='a,b'")
    assert nested.set == ["arena.size_m=[1, 2]", "robots.body={kind='x', radius_m=1}", "name='a,b'"]


@pytest.mark.parametrize("text", ["", ":a=1", "name:", "name:a", "na/me", "name:a=1,b"])
def test_a_malformed_variant_is_an_error_of_one_line(text: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_variant(text)
    assert caught.value.mistakes == [f"--variant: expected NAME or NAME:PATH=VALUE,PATH=VALUE, got {text!r}"]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("radio.loss=0,0.1,...,0.4", [0.0, 0.1, 0.2, 0.3, 0.4]),
        ("robots.count=10,20,...,40", [10, 20, 30, 40]),
        ("radio.loss=0.9,0.6,...,0", [0.9, 0.6, 0.3, 0.0]),
        ("radio.loss=0,0.5", [0.0, 0.5]),
        ("services.path=coordinator,gradient", ["coordinator", "gradient"]),
        ("robots.body.collide=true,false", [True, False]),
    ],
)
def test_a_sweep_lists_its_values_or_counts_them(text: str, values: list[object]) -> None:
    sweep = parse_sweep(text)
    assert sweep.values == values
    assert {type(each) for each in sweep.values} == {type(values[0])}
    assert sweep.levels == {}


def test_a_sweep_of_tables_and_arrays_has_named_levels() -> None:
    sweep = parse_sweep("a.models+b.models=none:[],bursts:[{kind='bursts', n=3}],[1, 2]")
    assert sweep.values == ["none", "bursts", "[1, 2]"]
    assert sweep.levels["bursts"] == ["a.models=[{kind='bursts', n=3}]", "b.models=[{kind='bursts', n=3}]"]
    assert sweep.levels["[1, 2]"] == ["a.models=[1, 2]", "b.models=[1, 2]"]


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("radio.loss", "expected PATH=VALUE,VALUE"),
        ("=1,2", "expected PATH=VALUE,VALUE"),
        ("radio.loss=", "expected PATH=VALUE,VALUE"),
        ("radio.loss=0,0.3,...,1", "expected FIRST,SECOND,...,LAST in even steps"),
        ("radio.loss=0,...,1", "expected FIRST,SECOND,...,LAST in even steps"),
        ("radio.loss=1,2,...,0", "expected FIRST,SECOND,...,LAST in even steps"),
        ("radio.loss=0,0,...,1", "expected FIRST,SECOND,...,LAST in even steps"),
        ("radio.loss=a,b,...,c", "expected FIRST,SECOND,...,LAST in even steps"),
    ],
)
def test_a_malformed_sweep_is_an_error_of_one_line(text: str, rule: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_sweep(text)
    assert caught.value.mistakes == [f"--sweep: {rule}, got {text!r}"]


def test_a_comparison_needs_two_variants() -> None:
    with pytest.raises(ScenarioError, match="variants: expected 2 at least to compare, got 0"):
        make_comparison("gossip-max")


def test_an_axis_sets_one_path_or_several_or_levels_of_settings(gossip: Path) -> None:
    sweeps = ("radio.loss+robots.sensors.0.false_negative=0.25,0.5", "models=none:[],late:[]")
    study = planned(gossip, sweeps, base=None)
    study.table.set.append("robots.sensors=[{kind='line_of_sight'}]")
    study.table.levels["models"] = {
        "none": [],
        "late": ["radio.models=[{kind='delay', delay_s=0.3}]", "robots.count=4"],
    }
    points = make_points(study)
    assert [point.label for point in points][:4] == [
        f"often, radio.loss+robots.sensors.0.false_negative={loss}, models={model}"
        for loss in (0.25, 0.5)
        for model in ("none", "late")
    ]
    last = points[-1].scenario
    assert last.radio is not None
    assert (last.radio.loss, last.robots.sensors[0].model_dump()["false_negative"]) == (0.5, 0.5)
    assert [each.model_dump()["delay_s"] for each in last.radio.models] == [0.3]
    assert (last.robots.count, points[2].scenario.robots.count) == (4, 10)


def test_arguments_override_the_variants_grid_and_settings_of_a_study(tmp_path: Path, gossip: Path) -> None:
    (tmp_path / "ways.toml").write_text(
        'seeds = 7\nmetrics = ["delivered_fraction"]\nscenario = "none"\nset = ["robots.count=5"]\n'
        '[[variants]]\nname = "a"\n[[variants]]\nname = "b"\nset = ["radio.loss=0.1"]\n'
        '[grid]\nlag = ["none", "long"]\n"time.duration_s" = [1.0]\n'
        "[levels.lag]\nnone = []\nlong = [\"radio.models=[{kind='delay', delay_s=0.5}]\"]\n"
    )
    base = load_study(str(tmp_path / "ways.toml"))
    study = make_comparison(str(gossip), sweeps=[parse_sweep("time.duration_s=2.0,3.0")], base=base)
    assert list(study.table.grid) == ["time.duration_s", "lag"]
    assert (study.table.seeds, study.table.metrics) == (list(range(1, 8)), ["delivered_fraction"])
    assert [variant.name for variant in study.variants] == ["a", "b"]
    assert {point.scenario.robots.count for point in make_points(study)} == {5}
    assert make_comparison(str(gossip), metrics=["ticks"], base=base).table.metrics == ["ticks"]
    late = make_comparison(str(gossip), sweeps=[parse_sweep("lag=long")], base=base)
    assert [len(point.scenario.radio.models) for point in make_points(late) if point.scenario.radio] == [1, 1]
    with pytest.raises(ScenarioError, match="lag: unknown key"):
        make_points(make_comparison(str(gossip), sweeps=[parse_sweep("lag=longer")], base=base))


@pytest.mark.parametrize(
    ("levels", "mistake"),
    [
        ("[levels.other]\na = []", "levels.other: the grid has no such axis"),
        ("[levels.lag]\nnone = []", "levels.lag: expected what 'long' of the grid sets"),
    ],
)
def test_an_error_in_levels_is_one_line(tmp_path: Path, levels: str, mistake: str) -> None:
    text = 'scenario = "gossip-max"\nseeds = 1\nmetrics = ["delivered_fraction"]\n[grid]\nlag = ["none", "long"]\n'
    (tmp_path / "ways.toml").write_text(text + levels)
    with pytest.raises(ScenarioError, match=mistake):
        load_study(str(tmp_path / "ways.toml"))
