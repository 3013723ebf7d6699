"""A small part of the campaign `bench_malformed`: mutated messages, scenarios and maps end in no traceback."""

import random
from collections import Counter
from pathlib import Path

import pytest
from support import ROOT, script

from zwerm.errors import ScenarioError

bench_malformed = script(ROOT / "benchmarks" / "reliability" / "bench_malformed.py")


def test_every_decoder_refuses_malformed_messages_with_its_own_errors() -> None:
    counts: dict[str, Counter[str]] = {name: Counter() for name in bench_malformed.DECODERS}
    bench_malformed.decode_all(bench_malformed.mutants(3, 20_000), counts)
    assert all(each.total() == 20_000 for each in counts.values())
    assert counts["answer"]["accepted"] > 100, "the mutants are near enough to valid messages to reach every check"


def test_a_decoder_that_raises_another_error_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(bench_malformed.DECODERS, "wrong", lambda message: message[40])
    with pytest.raises(IndexError):
        bench_malformed.decode_all(
            bench_malformed.mutants(3, 100), {name: Counter() for name in bench_malformed.DECODERS}
        )


def test_mutated_scenarios_are_accepted_or_refused_in_words(tmp_path: Path) -> None:
    draw = random.Random(11)
    texts = [(bench_malformed.SCENARIOS / f"gossip/{name}.toml").read_text() for name in ("gossip-max", "beacon")]
    outcomes = Counter[str]()
    for number in range(60):
        path = tmp_path / f"{number}.toml"
        path.write_text(bench_malformed.mutated(draw.choice(texts), draw), encoding="utf-8")
        outcomes[bench_malformed.try_scenario(path)] += 1
    assert set(outcomes) == {"accepted", "refused"}


def test_mutated_maps_are_accepted_or_refused_in_words(tmp_path: Path) -> None:
    draw, name = random.Random(12), "robot-teams-map"
    for suffix in (".toml", ".map", ".mcpp"):
        (tmp_path / f"{name}{suffix}").write_bytes(
            (bench_malformed.SCENARIOS / f"robot_teams/{name}{suffix}").read_bytes()
        )
    whole = (tmp_path / f"{name}.map").read_bytes()
    outcomes = Counter[str]()
    for _ in range(20):
        (tmp_path / f"{name}.map").write_bytes(bench_malformed.mutated_bytes(whole, draw))
        outcomes[bench_malformed.try_scenario(tmp_path / f"{name}.toml")] += 1
    assert set(outcomes) <= {"accepted", "refused"}
    assert outcomes["refused"]


def test_a_period_of_samples_without_end_is_no_traceback() -> None:
    settings = ("metrics.every_s=1e308", "time.dt_s=0.1")
    observers = bench_malformed.prepare(bench_malformed.load("voronoi-light", settings)).observers
    assert not observers.is_due(10**9)


@pytest.mark.parametrize("value", ['"\\u0000"', "[]", "true", "nan"])
def test_a_footprint_of_another_type_is_no_traceback(value: str) -> None:
    with pytest.raises(ScenarioError, match=r"robots.parameters.footprint_m"):
        bench_malformed.prepare(bench_malformed.load("robot-teams-one", (f"robots.parameters.footprint_m={value}",)))
