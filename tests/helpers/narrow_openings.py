"""Runs in drawn buildings with a narrow opening."""

from benchmarks.common.small_buildings import small_building
from zwerm.run.result import RunResult
from zwerm.run.runner import run

EXACT = ("robots.sensors.0.sd_rad=0.0",)
NOISY = ("robots.sensors.0.sd_rad=0.0436332",)


def carry_out(seed: int, dies: bool, more: tuple[str, ...]) -> RunResult:
    """Run the building of a seed."""
    building = small_building(seed)
    settings = (
        *building.settings(),
        *((building.death(),) if dies else ()),
        "robots.count=30",
        "time.duration_s=3000.0",
    )
    return run("sensor-coverage-narrow", seed, "inline", (*settings, *more))
