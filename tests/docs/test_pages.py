"""The pages of the documentation: their generated parts are up to date, and every measured table has its provenance."""

import argparse
import dataclasses
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from support import ROOT, script

from zwerm import RunResult, ScenarioError, Setup
from zwerm.compare.comparison import make_comparison
from zwerm.compare.variants import parse_sweep, parse_variant, split
from zwerm.study.study_tables import Study, load_study
from zwerm.study.trial_plan import make_points

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
NUMBER = re.compile(r"[≥≤±+\-−]?\d[\d,.]*( ?(%|s|ms|µs|m|mm|MB|GB|robots))?")
NUMBERS_MAX = 2
# Tables that hold numbers and no measurements, by page and first line.
NOT_MEASURED: dict[str, set[str]] = {
    "concepts/architecture.md": {"| step | method | effect |"},
    "papers/robot-teams.md": {"| part | what it does | section |", "| parameter | default | what it is |"},
    "comparison.md": {"| | Zwerm | ARGoS | Webots | VMAS | IR-SIM | ROS 2 with Gazebo |"},
}


@pytest.fixture(scope="module")
def pages() -> ModuleType:
    return script(DOCS / "pages.py")


@pytest.fixture(scope="module")
def measured() -> ModuleType:
    return script(DOCS / "_measured.py")


@pytest.fixture(scope="module")
def measure() -> ModuleType:
    return script(DOCS / "measure.py")


def name_of(page: Path) -> str:
    return page.relative_to(DOCS).as_posix()


# --- parts ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_generated_parts_of_a_page_are_up_to_date(pages: ModuleType, page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text == pages.filled(text, page), "run: make pages"


def test_every_generator_is_used_once_and_every_mark_is_known(pages: ModuleType) -> None:
    used = [mark for page in PAGES for mark in pages.marks(page.read_text(encoding="utf-8"))]
    assert sorted(name for kind, name in used if kind == "generated") == sorted(pages._generate.GENERATED)
    assert {name for kind, name in used if kind == "measured"} == set(pages._measured.plans()["tables"])


def test_a_part_is_replaced_and_the_text_around_it_stays(pages: ModuleType) -> None:
    page = DOCS / "page.md"
    bare = "before\n\n<!-- generated: built-in-scenarios -->\n\nafter\n"
    once = pages.filled(bare, page)
    assert once.startswith("before\n\n<!-- generated: built-in-scenarios -->\n\n| scenario |")
    assert once.endswith("|\n\n<!-- end -->\n\nafter\n")
    assert "`computation-free`" in once
    assert pages.filled(once, page) == once
    assert pages.filled(once.replace("`computation-free`", "`stale`"), page) == once


def test_a_mark_without_an_end_does_not_take_in_the_next_part(pages: ModuleType) -> None:
    filled = pages.filled("<!-- generated: faults -->\n\nbetween\n\n<!-- generated: fields -->\n", DOCS / "page.md")
    assert "\n\nbetween\n\n" in filled
    assert filled.count("<!-- end -->") == 2


def test_an_unknown_mark_is_refused(pages: ModuleType) -> None:
    with pytest.raises(KeyError):
        pages.filled("<!-- measured: no-such-table -->\n", DOCS / "page.md")


# --- the store ------------------------------------------------------------------------------------------------------


def test_every_stored_table_has_a_plan_a_provenance_and_a_file(measured: ModuleType) -> None:
    files = {path.stem for path in measured.STORE.glob("*.csv")}
    measured_tables = {name for name, plan in measured.plans()["tables"].items() if "of" not in plan}
    assert files == measured_tables == set(measured.origins())


def test_every_provenance_is_complete_and_names_no_machine(measured: ModuleType) -> None:
    for name, origin in measured.origins().items():
        assert tuple(origin) == measured.PROVENANCE, name
        assert origin["source"] in (measured.MEASURED, measured.RECORDED), name
        assert re.fullmatch(r"[0-9a-f]{7,40}", origin["commit"]), (
            f"{name}: measured with changes that are not committed"
        )
        assert re.fullmatch(r"\d{4}-\d{2}-\d{2}", origin["date"]), name
        assert re.match(r"\d+ cores, \d+ GB", origin["machine"]), name
        assert re.match(r"(zwerm|python|make) ", origin["command"]), name
        assert not re.search(r"(^| )/\w|@|localhost", " ".join(origin.values())), name


def test_every_table_is_measured_by_a_command_or_names_its_origin(measured: ModuleType) -> None:
    for name, plan in measured.plans()["tables"].items():
        assert len({"command", "recorded_command", "of"} & plan.keys()) == 1, name
        known = set(measured.plans()["metrics"])
        assert {metric.partition(":")[0] for metric in plan.get("metrics", [])} <= known, name


def planned(words: list[str]) -> Study:
    """Return the study that a plan's command runs. Raises ScenarioError for a command with a mistake."""
    if words[0] == "study":
        return load_study(words[1])
    parser = argparse.ArgumentParser()
    parser.add_argument("scenario")
    for option in ("--variant", "--sweep", "--set"):
        parser.add_argument(option, action="append", default=[])
    parser.add_argument("--variants")
    parser.add_argument("--metrics", default="")
    given = parser.parse_args(words[1:])
    base = load_study(given.variants) if given.variants else None
    variants, sweeps = [parse_variant(each) for each in given.variant], [parse_sweep(each) for each in given.sweep]
    study = make_comparison(given.scenario, variants, sweeps, split(given.metrics), base)
    table = study.table.model_copy(update={"set": [*study.table.set, *given.set]})
    return dataclasses.replace(study, table=table)


def test_every_command_of_the_plan_can_be_run(measured: ModuleType) -> None:
    for name, plan in measured.plans()["tables"].items():
        command = plan.get("command", ["of"])
        if command[0] in ("study", "compare"):
            assert make_points(planned(command)), name
        elif command[0] not in ("of", "twin"):
            module, name_of_module = command[:2]
            assert module == "-m", name
            assert (ROOT / f"{name_of_module.replace('.', '/')}.py").is_file(), name


def test_a_command_of_a_plan_with_a_mistake_is_found() -> None:
    for words in (["compare", "beacon", "--variant", "a", "--variant", "b, c"], ["study", "no-such-study"]):
        with pytest.raises(ScenarioError):
            planned(words)
    with pytest.raises(ScenarioError, match=r"radio\.los"):
        make_points(planned(["compare", "beacon", "--variant", "a", "--variant", "b:radio.los=0.1"]))


def hand_typed(text: str, mark: re.Pattern[str]) -> list[str]:
    """Return the first line of every table with numbers in it that is not part of a generated block."""
    found = []
    for table in re.findall(r"(?:^\|.*\n)+", mark.sub("", text), re.MULTILINE):
        header, _, *lines = table.splitlines()
        cells = [cell.strip(" *`") for line in lines for cell in line.strip("|").split("|")]
        if sum(bool(NUMBER.match(cell)) for cell in cells) > NUMBERS_MAX:
            found.append(header)
    return found


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_no_table_of_measurements_is_typed_by_hand(pages: ModuleType, page: Path) -> None:
    assert set(hand_typed(page.read_text(encoding="utf-8"), pages.MARK)) <= NOT_MEASURED.get(name_of(page), set())


def test_a_table_typed_by_hand_is_found(pages: ModuleType) -> None:
    table = "| a | b |\n| --- | --- |\n| 1.0 ± 0.1 | **2,000** |\n| x | 3 % |\n"
    assert hand_typed(table, pages.MARK) == ["| a | b |"]
    assert hand_typed(f"<!-- measured: x -->\n\n{table}\n\n<!-- end -->\n", pages.MARK) == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_no_interval_is_typed_by_hand(pages: ModuleType, page: Path) -> None:
    assert re.findall(r".*± ?\d.*", pages.MARK.sub("", page.read_text(encoding="utf-8"))) == []


# --- tables ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mean", "half", "text"),
    [
        ("88.7213", "0.8312", "88.72 ± 0.83"),
        ("1390.2", "41.2", "1,390 ± 41"),
        ("37", "0", "37 ± 0"),
        ("0.00123456", "", "0.001235"),
        ("15938", "", "15,938"),
        ("1", "1e-16", "1 ± 0"),
    ],
)
def test_a_mean_is_shown_to_the_second_digit_of_its_interval(
    measured: ModuleType, mean: str, half: str, text: str
) -> None:
    assert measured.plus_minus(mean, half) == text


ROW = {"metric": "sim_s", "n": "4", "mean": "0.5", "sd": "0.1", "half_width": "0.2", "least": "0.25", "most": "0.75"}


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ({}, "0.5 ± 0.2"),
        ({"scale": 100.0, "unit": " %"}, "50 ± 20 %"),
        ({"show": "least", "digits": 4}, "0.2500"),
        ({"show": "most"}, "0.75"),
        ({"show": "count"}, "2 of 4"),
    ],
)
def test_a_value_is_shown_as_its_metric_asks(measured: ModuleType, kind: dict[str, object], text: str) -> None:
    assert measured.value(ROW, kind, trials=4) == text


def test_a_value_has_the_spread_that_its_plan_asks_for(measured: ModuleType) -> None:
    assert measured.value(ROW, {}, trials=4, spread="sd") == "0.5 ± 0.2 (sd 0.1)"
    assert measured.value(ROW, {}, trials=4, spread="range") == "0.25 to 0.75"
    assert measured.value(ROW | {"most": "0.25"}, {}, trials=4, spread="range") == "0.25"


def test_a_value_of_some_trials_shows_their_number(measured: ModuleType) -> None:
    assert measured.value(ROW, {}, trials=5) == "0.5 ± 0.2 (4 of 5)"
    none = {"n": "0", "mean": "", "half_width": ""}
    assert measured.value({"metric": "convergence_time_s", **none}, {}, trials=5) == "never"
    assert measured.value({"metric": "unsafe_removals", **none}, {}, trials=5) == ""


@pytest.mark.parametrize(("half", "text"), [("0.5", "+1.0 ± 0.5 * (+50 %)"), ("1.5", "+1.0 ± 1.5 (+50 %)")])
def test_a_difference_has_a_star_where_its_interval_excludes_zero(measured: ModuleType, half: str, text: str) -> None:
    row = {"difference": "1", "difference_half_width": half}
    assert measured.difference(row, {"mean": "2"}, {}) == text


# --- measuring ------------------------------------------------------------------------------------------------------


def test_a_comparison_is_measured_and_stored_with_its_provenance(
    measure: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = {
        "command": [
            *("compare", "gossip-max", "--variant", "often", "--variant", "seldom:robots.parameters.every_ticks=5"),
            *("--metrics", "messages_per_robot_mean", "--set", "time.duration_s=3.0"),
        ]
    }
    store = sys.modules["_measured"]
    monkeypatch.setattr(store, "STORE", tmp_path)
    monkeypatch.setattr(measure, "RUNS", tmp_path / "runs")
    (tmp_path / "plan.toml").write_text('[metrics]\n[tables.gossip]\nlayout = "metrics"\n', encoding="utf-8")
    measure.measure("gossip", plan, "2", 1)
    origin = tomllib.loads((tmp_path / "index.toml").read_text(encoding="utf-8"))["gossip"]
    assert tuple(origin) == store.PROVENANCE
    assert origin["command"].endswith("--seeds 2")
    assert origin["trials"] == "2"
    rows = {(row["variant"], row["metric"]): row for row in store.load("gossip").rows}
    often, seldom = rows["often", "messages_per_robot_mean"], rows["seldom", "messages_per_robot_mean"]
    assert often["n"] == seldom["pairs"] == "2"
    assert float(seldom["mean"]) - float(often["mean"]) == pytest.approx(float(seldom["difference"]), rel=1e-4)
    assert float(often["least"]) <= float(often["mean"]) <= float(often["most"])
    table = store.render("gossip")
    assert table.startswith("|  | often | seldom | difference |")
    assert f"commit `{origin['commit']}`" in table


def test_a_command_that_fails_stores_nothing(
    measure: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["_measured"], "STORE", tmp_path)
    monkeypatch.setattr(measure, "RUNS", tmp_path / "runs")
    plan = {"command": ["study", "no-such-study"]}
    assert not measure.measure("nothing", plan, "1", 1)
    assert list(tmp_path.glob("*.csv")) == []
    assert not (tmp_path / "index.toml").exists()


def test_a_plan_that_is_not_known_is_refused_by_name(
    measure: ModuleType, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["measure.py", "no-such-table"])
    with pytest.raises(SystemExit) as left:
        measure.main()
    assert left.value.code == 2
    assert "no-such-table: expected one of " in capsys.readouterr().err


def test_a_field_without_a_meaning_is_found() -> None:
    objects = script(DOCS / "_objects.py")

    class Bare:
        """A class."""

        speed: float = 1.0

    with pytest.raises(KeyError, match=r"Bare\.speed: no comment says what it means"):
        list(objects.field_rows(Bare))
    assert [name for name, _, _ in objects.field_rows(RunResult)] == list(RunResult.__dataclass_fields__)
    assert [name for name, _, _ in objects.field_rows(Setup)] == list(Setup.__struct_fields__)
