"""Renamed keys: the old name works with one warning, and the new one without."""

from pathlib import Path
from typing import Any

import pytest

from zwerm.errors import ScenarioError
from zwerm.scenario import renamed
from zwerm.scenario.load import load, validate

ENTRANCE = {"every_s": 1.0, "entry_m": [0.0, 0.0, 1.0, 1.0]}


def tables(**robots: Any) -> dict[str, Any]:
    return {
        "name": "small",
        "arena": {"size_m": [2.0, 2.0]},
        "robots": {"count": 4, "controller": "random-walk", **robots},
    }


@pytest.fixture(autouse=True)
def no_warning_yet(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(renamed, "_warned", {})


def test_the_old_key_of_the_entrance_gives_the_same_scenario_with_one_warning_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    old = validate(tables(inflow=ENTRANCE), "small.toml", Path())
    validate(tables(inflow=ENTRANCE), "small.toml", Path())
    assert capsys.readouterr().err == "zwerm: warning: small.toml: robots.inflow is deprecated, use robots.entrance\n"
    assert old == validate(tables(entrance=ENTRANCE), "small.toml", Path())
    assert capsys.readouterr().err == ""


def test_the_tables_given_keep_their_old_key() -> None:
    given = tables(inflow=ENTRANCE)
    validate(given, "small.toml", Path())
    assert given == tables(inflow=ENTRANCE)


def test_an_override_may_use_the_old_key_of_a_table_that_has_the_new_one(capsys: pytest.CaptureFixture[str]) -> None:
    scenario = load("computation-free-maze", ("robots.inflow.every_s=2.5",))
    assert scenario.robots.entrance is not None
    assert scenario.robots.entrance.every_s == 2.5
    assert capsys.readouterr().err == "zwerm: warning: --set: robots.inflow is deprecated, use robots.entrance\n"


def test_the_old_and_the_new_key_together_are_a_mistake() -> None:
    with pytest.raises(ScenarioError) as caught:
        validate(tables(inflow=ENTRANCE, entrance=ENTRANCE), "small.toml", Path())
    assert caught.value.mistakes == [
        "small.toml: robots.inflow: deprecated name of robots.entrance, expected only one of them"
    ]


def test_a_renamed_kind_is_replaced_wherever_it_stands_in_its_array(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(renamed, "KINDS", {"radio.models": {"old": "new"}})
    warnings: list[str] = []
    given: dict[str, Any] = {"radio": {"models": [{"kind": "loss"}, {"kind": "old"}]}}
    renamed.rename(given, "small.toml", warnings.append)
    assert given == {"radio": {"models": [{"kind": "loss"}, {"kind": "new"}]}}
    assert warnings == ["small.toml: radio.models.1.kind: 'old' is deprecated, use 'new'"]
