"""The order in which the trials of a study begin: by seed, except where a long trial would then end last and alone.

So an interrupted study has results of every point, and all workers stay busy until the end.
"""

from collections.abc import Iterable, Sequence

from zwerm.study.trial import Row
from zwerm.study.trial_plan import Point, Trial


def in_order(trials: Sequence[Trial], rows: Iterable[Row], workers: int) -> list[Trial]:
    """Return `trials` in the order in which `workers` begin them.

    Each trial begins at the latest when its own duration is left of the study's. `rows` are results so far: their durations
    are those of other trials of the same point. A point without rows is judged by its robots and its ticks.
    """
    cost_s = _costs(trials, rows)
    costs = [cost_s[trial.key[:2]] for trial in trials]
    total_s = sum(costs) / workers
    begun_s, latest = 0.0, []
    for cost in costs:
        latest.append(min(begun_s, total_s - cost))
        begun_s += cost / workers
    # Equal starts keep their order: sorting is stable.
    return [trials[index] for index in sorted(range(len(trials)), key=latest.__getitem__)]


def _costs(trials: Sequence[Trial], rows: Iterable[Row]) -> dict[tuple[str, str], float]:
    """Return the expected duration [s] of a trial of each point, by variant and fingerprint."""
    durations: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        if "wall_s" in row:
            durations.setdefault((row["variant"], row["fingerprint"]), []).append(row["wall_s"])
    points = {trial.key[:2]: trial.point for trial in trials}
    measured = {key: sum(each) / len(each) for key, each in durations.items() if key in points}
    work = sum(_work(points[key]) for key in measured)
    second = sum(measured.values()) / work if work else 1.0
    return {key: measured.get(key, _work(point) * second) for key, point in points.items()}


def _work(point: Point) -> float:
    """Return the robot-ticks of a trial that lasts as long as it may."""
    scenario = point.scenario
    return scenario.robots.count * scenario.time.duration_s / scenario.time.dt_s
