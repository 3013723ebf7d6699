"""A study's rows condensed: for every point and metric its mean, how sure it is, and how far the paper's value is from it.

A paper's value counts as met where it lies within the 95 % interval of our mean, widened by the paper's own interval
(where the study says over how many trials the paper's mean was taken: same spread, Student's t) and by the tolerance of
what it prints. One comparison in twenty of a perfect replica falls outside. Trials that failed are counted, not averaged.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from zwerm.maths.statistics import Sample, condense, half_width
from zwerm.study.plan import Point
from zwerm.study.tables import Published, Setting, Study
from zwerm.study.trial import Row
from zwerm.world.drivers.lockstep import FAILED
from zwerm.world.scene import Floats

# Metrics of all trials of a point together: of the mean number of robots in each cell, the least and the most.
CELL_METRICS = {"least_cell_robots": np.argmin, "most_cell_robots": np.argmax}


@dataclass(frozen=True)
class SummaryLine:
    """One metric at one point, beside what the paper says of it."""

    variant: str
    settings: Mapping[str, Setting]
    metric: str
    sample: Sample
    published: Published | None = None
    paper_trials: int | None = None

    @property
    def paper(self) -> float | None:
        """The paper's value, or the bound it claims."""
        if self.published is None:
            return None
        return self.published.at_least if self.published.value is None else self.published.value

    @property
    def is_bound(self) -> bool:
        """Whether the paper says `at least`."""
        return self.published is not None and self.published.value is None

    @property
    def difference(self) -> float | None:
        """Our mean less the paper's value."""
        return None if self.paper is None or self.sample.n == 0 else self.sample.mean - self.paper

    @property
    def agrees(self) -> bool | None:
        """Whether the paper's value can be that of what we ran; None where too few trials or no value leave it open."""
        if self.difference is None or self.published is None or math.isnan(self.sample.sd):
            return None
        # Over fewer trials the least of many means is lower, whatever the swarm does.
        if self.metric in CELL_METRICS and self.sample.n < (self.paper_trials or 0):
            return None
        margin = half_width(self.sample.sd, self.sample.n, self.paper_trials) + (self.published.tolerance or 0.0)
        # A value that is off by a rounding error of the subtraction is not off.
        margin += 1e-12
        return self.difference >= -margin if self.is_bound else abs(self.difference) <= margin


class Results:
    """The rows of a study's points that are there so far, grouped by point."""

    def __init__(self, study: Study, points: Sequence[Point], rows: Sequence[Row]) -> None:
        self.study = study
        self.points = points
        self._rows: dict[tuple[str, str], list[Row]] = defaultdict(list)
        for row in rows:
            self._rows[row["variant"], row["fingerprint"]].append(row)
        self.failures = Counter(row["reason"] for row in rows if row["outcome"] == FAILED)
        self.known_metrics = sorted({name for row in rows for name in row if isinstance(row[name], float)})

    def every_row(self, point: Point) -> list[Row]:
        """Return the rows of a point's trials, by seed."""
        return sorted(self._rows[point.variant, point.fingerprint], key=lambda row: int(row["seed"]))

    def rows(self, point: Point) -> list[Row]:
        """Return the rows of a point's trials that did not fail, by seed."""
        return [row for row in self.every_row(point) if row["outcome"] != FAILED]

    def sample(self, point: Point, metric: str) -> Sample:
        """Return a metric of a point, condensed."""
        if metric in CELL_METRICS:
            counts = self.cell_counts(point)
            if not len(counts):
                return condense([])
            cell = int(CELL_METRICS[metric](counts.mean(axis=0)))
            return condense(counts[:, cell].tolist())
        values = [row[metric] for row in self.rows(point) if metric in row]
        return condense([value for value in values if not math.isnan(value)])

    def cell_counts(self, point: Point) -> Floats:
        """Return (n, cells) the number of robots in each cell at the end of each of n trials, cells row by row."""
        return np.array([row["cell_counts"] for row in self.rows(point) if "cell_counts" in row], dtype=np.float64)

    def line(self, point: Point, metric: str) -> SummaryLine:
        """Return a metric of a point beside the paper's."""
        published = self.study.published(point.variant, point.settings).get(metric)
        sample = self.sample(point, metric)
        return SummaryLine(point.variant, point.settings, metric, sample, published, self.study.table.paper.trials)

    def lines(self) -> list[SummaryLine]:
        """Return every metric of every point beside the paper's."""
        return [self.line(point, metric) for point in self.points for metric in self.study.table.metrics]

    def unknown_metrics(self) -> list[str]:
        """Return what the study reports and no trial measured."""
        measured = {line.metric for line in self.lines() if line.sample.n}
        return [metric for metric in self.study.table.metrics if metric not in measured]
