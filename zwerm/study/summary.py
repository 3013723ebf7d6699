"""Statistics of a study's rows: for each point and metric the mean, its interval, and the difference from the paper.

A paper's value agrees if it lies within the 95 % interval of the measured mean. The interval is widened by the
tolerance of printed values, and by the paper's own interval if the study gives the paper's number of trials (same
spread, Student's t). A perfect replica fails one comparison in twenty. Failed trials are counted but not averaged.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from zwerm.maths.statistics import Sample, condense, half_width
from zwerm.study.study_tables import CELL_METRICS, Published, Setting, Study
from zwerm.study.trial import Row
from zwerm.study.trial_plan import Point
from zwerm.world.scene import Floats
from zwerm.world.tick.completion import FAILED

_CELL_CHOICE = dict(zip(CELL_METRICS, (np.argmin, np.argmax), strict=True))


@dataclass(frozen=True)
class SummaryLine:
    """One metric at one point, with the paper's value."""

    variant: str
    settings: Mapping[str, Setting]
    metric: str
    sample: Sample
    published: Published | None = None
    paper_trials: int | None = None

    @property
    def paper(self) -> float | None:
        """The paper's value, or its lower bound."""
        if self.published is None:
            return None
        return self.published.at_least if self.published.value is None else self.published.value

    @property
    def is_bound(self) -> bool:
        """True if the paper gives a lower bound, `at least`."""
        return self.published is not None and self.published.value is None

    @property
    def difference(self) -> float | None:
        """The measured mean minus the paper's value."""
        return None if self.paper is None or self.sample.n == 0 else self.sample.mean - self.paper

    @property
    def agrees(self) -> bool | None:
        """True if the paper's value agrees with the measured mean; None for too few trials or no value."""
        if self.difference is None or self.published is None or math.isnan(self.sample.sd):
            return None
        # The smallest of many means increases with the number of trials, for any swarm.
        if self.metric in CELL_METRICS and self.sample.n < (self.paper_trials or 0):
            return None
        margin = half_width(self.sample.sd, self.sample.n, self.paper_trials) + (self.published.tolerance or 0.0)
        # Allow for rounding errors of the subtraction.
        margin += 1e-12
        return self.difference >= -margin if self.is_bound else abs(self.difference) <= margin


class Results:
    """The rows of a study so far, grouped by point."""

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
        """Return the statistics of a metric at a point."""
        if metric in CELL_METRICS:
            counts = self.cell_counts(point)
            if not len(counts):
                return condense([])
            cell = int(_CELL_CHOICE[metric](counts.mean(axis=0)))
            return condense(counts[:, cell].tolist())
        values = [row[metric] for row in self.rows(point) if metric in row]
        return condense([value for value in values if not math.isnan(value)])

    def cell_counts(self, point: Point) -> Floats:
        """Return (n, cells) the number of robots in each cell at the end of each of n trials, cells row by row."""
        return np.array([row["cell_counts"] for row in self.rows(point) if "cell_counts" in row], dtype=np.float64)

    def line(self, point: Point, metric: str) -> SummaryLine:
        """Return a metric of a point with the paper's value."""
        published = self.study.published(point.variant, point.settings).get(metric)
        sample = self.sample(point, metric)
        return SummaryLine(point.variant, point.settings, metric, sample, published, self.study.table.paper.trials)

    def lines(self) -> list[SummaryLine]:
        """Return every metric of every point with the paper's value."""
        return [self.line(point, metric) for point in self.points for metric in self.study.table.metrics]

    def unknown_metrics(self) -> list[str]:
        """Return the metrics of the study that no trial measured."""
        measured = {line.metric for line in self.lines() if line.sample.n}
        return [metric for metric in self.study.table.metrics if metric not in measured]
