"""The documentation: its generated parts are complete, and every example in it works."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from support import script

import zwerm
from zwerm.catalogue import SENSORS
from zwerm.run.assembly import assemble
from zwerm.run.result import RunResult
from zwerm.scenario.load import built_in, validate
from zwerm.scenario.tables import Scenario
from zwerm.study.study_tables import StudyTable
from zwerm.wire.messages import Observation
from zwerm.world.sensors import registry as sensors

ROOT = Path(__file__).parents[2]
# Other tests follow these two pages from top to bottom.
FOLLOWED = ("tutorial.md", "recipes.md")
PAGES = [page for page in sorted((ROOT / "docs").rglob("*.md")) if page.name not in FOLLOWED]
FENCE = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def generated() -> ModuleType:
    return script(ROOT / "docs" / "_generate.py")


def examples(language: str) -> list[tuple[str, str, str]]:
    """Return (page, what stands behind the language, text) of every example in that language."""
    return [
        (page.name, words.strip(), text)
        for page in PAGES
        for name, words, text in FENCE.findall(page.read_text(encoding="utf-8"))
        if name == language
    ]


# --- what is generated ----------------------------------------------------------------------------------------------


def keys_of(model: type) -> set[str]:
    schema = model.model_json_schema()  # type: ignore[attr-defined]
    tables = [schema, *(each for name, each in schema["$defs"].items() if name != "OpenTable")]
    return {key for table in tables for key in table.get("properties", {})}


@pytest.mark.parametrize(("name", "model"), [("scenario-tables", Scenario), ("study-tables", StudyTable)])
def test_every_key_of_every_table_is_described(generated: ModuleType, name: str, model: type) -> None:
    assert set(re.findall(r"^\| `(\w+)` \|", generated.GENERATED[name](), re.MULTILINE)) >= keys_of(model)


def test_every_sensor_and_every_field_of_an_observation_is_described(generated: ModuleType) -> None:
    text = generated.GENERATED["sensors"]()
    assert set(re.findall(r"^### `(\w+)`", text, re.MULTILINE)) == set(SENSORS)
    for found in map(sensors.find, SENSORS):
        assert f"Fills `{found.field}`" in text
        for key in found.Parameters.model_fields:
            assert f"| `{key}` |" in text
    observation = generated.GENERATED["messages"]().split("###")[1]
    assert [key for key in Observation.__struct_fields__ if f"| `{key}` |" not in observation] == []


@pytest.mark.parametrize(
    ("schema", "words"),
    [
        ({"type": "number", "exclusiveMinimum": 0}, "number > 0"),
        ({"type": "integer", "minimum": 1, "maximum": 9}, "integer 1 to 9"),
        ({"anyOf": [{"type": "string"}, {"type": "null"}]}, "string"),
        ({"type": "array", "prefixItems": [{"type": "number"}, {"type": "integer"}]}, "[number, integer]"),
        ({"type": "array", "minItems": 2, "items": {"type": "string"}}, "array of string, 2 at least"),
        ({"enum": ["a", "b"], "type": "string"}, '"a" or "b"'),
        ({"const": "a", "type": "string"}, '"a"'),
        ({"type": "boolean"}, "true or false"),
        ({}, "any"),
    ],
)
def test_a_schema_is_put_into_words(generated: ModuleType, schema: dict[str, object], words: str) -> None:
    assert generated.in_words(schema) == words


# --- examples -------------------------------------------------------------------------------------------------------


# The tables that an example of a part of a scenario lacks.
REST: dict[str, dict[str, Any]] = {"arena": {"size_m": [2.0, 2.0]}, "robots": {"count": 2, "controller": "gossip-max"}}


@pytest.mark.parametrize(("page", "words", "text"), examples("toml"))
def test_every_toml_example_is_a_scenario_or_a_study_without_mistakes(page: str, words: str, text: str) -> None:
    if "study.toml" in words:
        StudyTable.model_validate(tomllib.loads(text))
    else:
        tables = {"name": "example"} | tomllib.loads(text)
        if "Part of a scenario" in words:
            tables = REST | tables | {"robots": REST["robots"] | tables.get("robots", {})}
        assemble(validate(tables, page, ROOT), seed=1)


def titled(words: str) -> str:
    found = re.fullmatch(r'title="(\w+)\.py"', words)
    return found[1] if found else ""


TITLED = [each for each in examples("python") if titled(each[1])]


@pytest.mark.parametrize(("page", "words", "text"), [each for each in TITLED if "truth: Truth" in each[2]])
def test_every_metric_in_the_documentation_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, page: str, words: str, text: str
) -> None:
    (tmp_path / f"{titled(words)}.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    overrides = [f'metrics.own=["{titled(words)}:order_parameter"]', "time.duration_s=3"]
    result = zwerm.run("computation-free", runner="inline", overrides=overrides)
    assert 0.0 <= result.metrics["order_parameter"] <= 1.0
    assert len(result.series["order_parameter"]) == 4


@pytest.mark.parametrize(("page", "words", "text"), [each for each in TITLED if "(Controller)" in each[2]])
def test_every_controller_in_the_documentation_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, page: str, words: str, text: str
) -> None:
    module = titled(words)
    (tmp_path / f"{module}.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    overrides = [f"robots.controller={module}:{module.capitalize()}", "time.duration_s=3", "radio={range_m = 1.0}"]
    result = zwerm.run("computation-free", runner="inline", overrides=overrides)
    assert result.outcome == ("completed" if module == "chatty" else "time-limit"), result.reason
    assert result.refused == {}
    if module == "patient":
        assert result.robot_ticks < result.robots * result.ticks / 5


@pytest.mark.parametrize(("page", "words", "text"), [each for each in examples("python") if not titled(each[1])])
def test_every_other_python_example_runs(tmp_path: Path, page: str, words: str, text: str) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    run = [sys.executable, "-c", text]
    done = subprocess.run(run, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("time-limit ") or "print(" not in text


def test_every_command_in_the_documentation_exists() -> None:
    shown = {
        line.split("zwerm ", 1)[1].split()[0]
        for _, _, text in examples("console")
        for line in text.splitlines()
        if "$ " in line and "zwerm " in line
    }
    known = subprocess.run(
        [sys.executable, "-c", "from zwerm.cli.app import main; main()", "--help"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert len(shown) > 3
    assert [command for command in sorted(shown) if not re.search(rf"\b{command}\b", known)] == []


METRICS = (ROOT / "docs" / "reference" / "metrics.md").read_text(encoding="utf-8").split("## Each metric")[1]


def undescribed(result: RunResult) -> list[str]:
    """Return the run's metrics that the reference does not have; it has one row for all rings."""
    rows = set(re.findall(r"`([\w.*]+)`", "".join(re.findall(r"^\|[^|]*\|", METRICS, re.MULTILINE))))
    families = [(r"^(density_ring)_\d+$", r"\1_*"), (r"^telemetry\..*$", "telemetry.NAME")]
    return [name for name in result.metrics if not any(re.sub(*family, name) in rows for family in families)]


@pytest.mark.parametrize("name", built_in())
def test_every_metric_of_every_built_in_scenario_is_described(name: str) -> None:
    # Faults may come later than that.
    assert undescribed(zwerm.run(name, runner="inline", overrides=["time.duration_s=2.0", "faults=[]"])) == []


def test_every_metric_of_a_deployment_that_is_done_and_of_real_time_is_described() -> None:
    hall = ["arena.size_m=[1.2,1.0]", "base.pose=[0.2,0.5,0.0]", "robots.count=8"]
    done = zwerm.run("sensor-coverage", runner="inline", overrides=hall)
    assert done.outcome == "completed"
    assert undescribed(done) == []
    paced = zwerm.run("computation-free", runner="inline", realtime=1e6, overrides=["time.duration_s=0.5"])
    assert undescribed(paced) == []


def test_every_key_of_the_json_output_is_described() -> None:
    described = (ROOT / "docs" / "how-to" / "running.md").read_text(encoding="utf-8")
    result = zwerm.run("computation-free", runner="inline", overrides=["time.duration_s=0.5"]).as_json()
    assert [key for key in (*result, *result["radio"], *result["nodes"]) if f"`{key}`" not in described] == []


def test_the_error_lines_in_the_documentation_are_the_real_ones(tmp_path: Path) -> None:
    text = "arena.size_m = [1, 1]\n[robots]\ncount = 0\ncontroller = 'random-walk'\nbody.radius_mm = 3\n"
    (tmp_path / "trial.toml").write_text(text, encoding="utf-8")
    check = [sys.executable, "-c", "from zwerm.cli.app import main; main()", "check", "trial.toml"]
    printed = subprocess.run(check, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert printed.returncode == 2
    assert printed.stderr in (ROOT / "docs" / "how-to" / "running.md").read_text(encoding="utf-8")
    assert printed.stderr.count("\n") == 2
