"""Cost of a tick against the number of robots, for families of scenarios at a constant density, inline on one core.

Prints the processor time of a tick, the time that pymunk alone takes for the same bodies in the same run, and the exponent of
cost in robots, fitted over at least 100 robots. The family `few-awake` has 5 robots that drive while all others sleep.
"""

import argparse
import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs
from zwerm.link import Answer
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import BodyVelocity, Command, Wake, decode_observation, encode
from zwerm.world.drivers.lockstep import LockStep

COUNTS: Final = (10, 30, 100, 300, 1000, 3000)
FITTED_MIN: Final = 100
EXPONENT_MAX: Final = 1.15
TICKS_MIN: Final = 12
TICKS_MAX: Final = 200
AWAKE: Final = 5


class Family(NamedTuple):
    """A scenario, the area of each robot [m^2], further settings, and what the robots do: None for their controller."""

    scenario: str
    area_m2: float
    settings: tuple[str, ...] = ()
    answer: Callable[[int], Answer] | None = None


def driving_or_asleep(node: int) -> Answer:
    """Return a robot that drives in a circle at every tick if it is one of the first, and sleeps otherwise."""

    def answer(payload: bytes) -> bytes:
        tick = decode_observation(payload).tick
        if node < AWAKE:
            return encode(Command(tick=tick, drive=BodyVelocity(0.1, 0.0, 0.5)))
        return encode(Command(tick=tick, wake=Wake(on_packet=True)))

    return answer


HOLONOMIC: Final = ('robots.body={kind="holonomic", radius_m=0.05, max_speed_m_s=0.5, substeps=2}',)
FAMILIES: Final[Mapping[str, Family]] = {
    "line-of-sight": Family("computation-free", 0.16, ('robots.placement={kind="uniform"}',)),
    # Five neighbours within 1 m in the mean.
    "radio": Family(
        "beacon",
        math.pi / 5.0,
        ("robots.parameters.speed_m_s=0.1", "arena.walls=[]", 'radio.models=[{kind="range", range_m=1.0}]', *HOLONOMIC),
    ),
    "bearings": Family(
        "beacon",
        math.pi / 5.0,
        (
            *("robots.parameters.speed_m_s=0.1", "robots.parameters.every_ticks=1000000", "arena.walls=[]"),
            *("radio.range_m=1.0", "radio.models=[]", 'robots.sensors=[{kind="bearings", range_m=1.0}]', *HOLONOMIC),
        ),
    ),
    "voronoi": Family("voronoi-coverage-table1", 0.0),
    "few-awake": Family(
        "beacon",
        math.pi / 5.0,
        (
            *("arena.walls=[]", 'radio.models=[{kind="range", range_m=1.0}]', *HOLONOMIC),
            'robots.sensors=[{kind="bearings", range_m=1.0}, {kind="touch"}, {kind="odometry"}]',
        ),
        driving_or_asleep,
    ),
}


def scenario_of(family: Family, count: int, ticks: int) -> Scenario:
    """Return the scenario of a family with `count` robots."""
    side_m = math.sqrt(family.area_m2 * count)
    size = (f"arena.size_m=[{side_m}, {side_m}]",) if side_m else ()
    dt_s = load(family.scenario).time.dt_s
    return load(family.scenario, (f"robots.count={count}", f"time.duration_s={ticks * dt_s}", *size, *family.settings))


def tick_s(family: Family, scenario: Scenario, seed: int) -> float:
    """Return the median processor time of a tick [s]."""
    world = assemble(scenario, seed)
    if family.answer is not None:
        nodes = {node: family.answer(node) for node in range(scenario.robots.count)}
    else:
        nodes = {node: Node(*spec).answer for node, spec in node_specs(scenario, seed).items()}
    ends: list[float] = []
    LockStep(world, MemoryLink(nodes), [lambda _: ends.append(time.process_time())]).run()
    return float(np.median(np.diff(ends)[len(ends) // 4 :]))


def physics_s(scenario: Scenario, seed: int, ticks: int = 20) -> float:
    """Return the median processor time in which pymunk alone moves the same bodies, all driven, by a tick [s]."""
    physics = assemble(scenario, seed).bodies.physics
    forward, turn = np.full(scenario.robots.count, 0.05), np.full(scenario.robots.count, 0.5)
    ends = []
    for _ in range(ticks):
        physics.advance(forward, None, turn)
        ends.append(time.process_time())
    return float(np.median(np.diff(ends)))


def exponent(counts: list[int], costs: list[float]) -> float:
    """Return the slope of the line through the logarithms, by least squares, over at least FITTED_MIN robots."""
    chosen = np.array(counts) >= FITTED_MIN
    if np.count_nonzero(chosen) < 2:
        return math.nan
    return float(np.polyfit(np.log(np.array(counts)[chosen]), np.log(np.array(costs)[chosen]), 1)[0])


def draw(path: Path, measured: Mapping[str, tuple[list[int], list[float], float]]) -> None:
    """Draw cost against robots on logarithmic axes."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    for name, (counts, costs, slope) in measured.items():
        axes.loglog(counts, np.array(costs) * 1e3, marker="o", label=f"{name}, exponent {slope:.2f}")
    axes.set_xlabel("robots")
    axes.set_ylabel("processor time of a tick [ms]")
    axes.grid(alpha=0.3, which="both")
    axes.legend()
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=list(FAMILIES))
    parser.add_argument("--counts", type=int, nargs="+", default=list(COUNTS))
    parser.add_argument("--robot-ticks", type=int, default=12_000, help="robot-ticks of a run, in 12 to 200 ticks")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw a log-log plot")
    add_csv_option(parser)
    options = parser.parse_args()
    rows: list[dict[str, str]] = []
    measured = {}
    print(f"{'family':<14} {'robots':>6} {'ms a tick':>10} {'us a robot':>10} {'pymunk alone, ms':>17}")
    for name in options.families:
        family, costs, floors = FAMILIES[name], [], []
        for count in options.counts:
            # Sleepers are parked after some ticks, and cost nothing then.
            ticks = TICKS_MAX if family.answer else min(TICKS_MAX, max(TICKS_MIN, options.robot_ticks // count))
            scenario = scenario_of(family, count, ticks)
            costs.append(min(tick_s(family, scenario, seed) for seed in range(1, options.repeats + 1)))
            floors.append(min(physics_s(scenario, seed) for seed in range(1, options.repeats + 1)))
            print(
                f"{name:<14} {count:>6} {1e3 * costs[-1]:>10.3f} {1e6 * costs[-1] / count:>10.2f}"
                f" {1e3 * floors[-1]:>17.3f}",
                flush=True,
            )
        slope = exponent(options.counts, costs)
        verdict = "met" if slope <= EXPONENT_MAX else "missed"
        print(f"{name:<14} exponent {slope:.2f}, at most {EXPONENT_MAX}: {verdict}", flush=True)
        measured[name] = options.counts, costs, slope
        rows += [
            {
                "family": name,
                "robots": f"{count}",
                "tick [ms]": f"{1e3 * cost:.3f}",
                "a robot and tick [µs]": f"{1e6 * cost / count:.2f}",
                "pymunk alone, same run [ms]": f"{1e3 * floor:.3f}",
                "exponent": f"{slope:.2f}" if count == options.counts[-1] else "",
                "at most": f"{EXPONENT_MAX}" if count == options.counts[-1] else "",
            }
            for count, cost, floor in zip(options.counts, costs, floors, strict=True)
        ]
    if options.figure is not None:
        draw(options.figure, measured)
    write_csv(options.csv, rows)


if __name__ == "__main__":
    main()
