"""A small scenario to compare variants of, and its comparison."""

from pathlib import Path
from typing import Any

from zwerm.compare.comparison import make_comparison
from zwerm.compare.variants import parse_sweep, parse_variant
from zwerm.study.study_tables import Study

# Ten robots in reach of each other, for two seconds; how often they speak is what the variants differ in.
GOSSIP = """
summary = "Ten robots agree"

[time]
dt_s = 0.1
duration_s = 2.0

[arena]
size_m = [2.0, 2.0]

[robots]
count = 10
controller = "gossip-max"
parameters = { done_at = 9 }

[radio]
range_m = 1.0
"""
VARIANTS = ["often", "seldom:robots.parameters.every_ticks=5"]


def planned(gossip: Path, sweeps: tuple[str, ...] = ("radio.loss=0.0,0.5",), **options: Any) -> Study:
    return make_comparison(
        str(gossip), [parse_variant(each) for each in VARIANTS], [parse_sweep(each) for each in sweeps], **options
    )
