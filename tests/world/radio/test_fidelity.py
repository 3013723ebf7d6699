"""The benchmark of the radio's fidelity, on few packets: every model is as accurate as stated, and a wrong model is
detected."""

import csv
from types import ModuleType

import pytest
from air import Radio, ring
from support import ROOT, script

from zwerm.catalogue import RADIO_MODELS


@pytest.fixture(scope="module")
def fidelity() -> ModuleType:
    return script(ROOT / "benchmarks" / "reliability" / "bench_fidelity.py")


def test_every_model_is_within_its_confidence_interval_over_thirty_thousand_packets(fidelity: ModuleType) -> None:
    rows = list(fidelity.measure(30_000, seed=1))
    assert [row for row in rows if not fidelity.is_inside(row)] == []
    with (ROOT / "docs" / "measurements" / "bench-fidelity.csv").open(encoding="utf-8", newline="") as file:
        published = {row["model"].strip("`") for row in csv.DictReader(file)}
    assert {row[0] for row in rows} == published
    assert published <= set(RADIO_MODELS)


def test_a_loss_that_is_wrong_by_a_tenth_is_outside_its_confidence_interval(fidelity: ModuleType) -> None:
    found = Radio(ring(40), [{"kind": "loss", "fraction": 0.33}], check=False).all_broadcast(20)
    assert not fidelity.is_inside(
        fidelity.row("loss", "", 0.3, found["dropped"]["loss"] / found["sent"], 0.46, found["sent"])
    )
