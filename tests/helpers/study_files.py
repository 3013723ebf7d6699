"""Small studies that several tests use: their scenario, their controllers and their files."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from zwerm.study.study_runner import StudyResult, run_study
from zwerm.study.study_tables import Study, load_study

DEADLINE_S = 60.0

SCENARIO = """
[time]
dt_s = 0.1
duration_s = 2.0

[arena]
size_m = [1.0, 1.0]

[robots]
count = 2
controller = "{controller}"

[robots.body]
kind = "differential"

[metrics]
cells = [2, 2]
"""

# A robot's random stream depends on the seed, so a controller can fail for some seeds.
CONTROLLERS = """
import os, time
from zwerm.agents.runtime.contract import Controller
from zwerm.wire.messages import Command, WheelSpeeds

class Drive(Controller):
    def step(self, observation):
        return Command(drive=WheelSpeeds(self.random.uniform(0, 0.1), self.random.uniform(0, 0.1)))

def unlucky(controller):
    return controller.setup.node == 0 and controller.random.random() < 0.4

class Raises(Drive):
    def step(self, observation):
        if observation.tick == 3 and unlucky(self):
            raise ValueError("no luck")
        return super().step(observation)

class Dies(Drive):
    def step(self, observation):
        if observation.tick == 3 and unlucky(self):
            os._exit(41)
        return super().step(observation)

class Slow(Drive):
    def step(self, observation):
        time.sleep(0.02)
        return super().step(observation)
"""


def study_writer(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Study]]:
    """Yield a function that writes a study of a tiny scenario into `folder` and loads it."""
    (folder / "study_robots.py").write_text(CONTROLLERS)
    monkeypatch.syspath_prepend(folder)

    def make(text: str, controller: str = "Drive", name: str = "tiny") -> Study:
        (folder / "tiny-scenario.toml").write_text(SCENARIO.format(controller=f"study_robots:{controller}"))
        file = folder / f"{name}.toml"
        file.write_text(text)
        return load_study(str(file))

    yield make
    sys.modules.pop("study_robots", None)


COVERING = """
name = "covering"
scenario = "voronoi-coverage-table1"
set = ["time.duration_s=1.0"]
seeds = 2
metrics = ["density_ring_01"]
"""
TINY = """
scenario = "tiny-scenario.toml"
seeds = 3
metrics = ["cell_coverage_fraction"]
"""
GRID = TINY + "[grid]\n'robots.count' = [1, 4]\n"


def without_wall_time(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{name: value for name, value in row.items() if name != "wall_s"} for row in rows]


def run_here(study: Study, out: Path, **options: Any) -> StudyResult:
    return run_study(study, out, jobs=1, **options)
