"""Statistics over trials: means and their confidence intervals.

Intervals are Student's, for independent trials; they do not cover a bias that all trials share.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.special import stdtrit

CONFIDENCE: Final = 0.95


class Sample(NamedTuple):
    """The summary of a sample. `sd` and `half_width` are nan for fewer than two trials."""

    n: int
    mean: float
    sd: float
    half_width: float  # of the interval of the mean


def condense(values: Sequence[float]) -> Sample:
    """Return the size, mean, standard deviation (n - 1) and half the 95 % interval of the mean; nan for no values."""
    n = len(values)
    if n == 0:
        return Sample(0, math.nan, math.nan, math.nan)
    mean = float(np.mean(values))
    if n == 1:
        return Sample(1, mean, math.nan, math.nan)
    sd = float(np.std(values, ddof=1)) if np.ptp(values) else 0.0  # the mean of equal numbers is rounded
    return Sample(n, mean, sd, half_width(sd, n))


def half_width(sd: float, n: int, n_other: int | None = None) -> float:
    """Return half the 95 % interval of a mean of `n` values, nan for fewer than two.

    With `n_other`, it is half the interval of the difference to the mean of that many other values. Both samples are
    assumed to have the same unknown standard deviation.
    """
    if n < 2:
        return math.nan
    quantile = float(stdtrit(n - 1, 0.5 + CONFIDENCE / 2.0))
    return quantile * sd * math.sqrt(1.0 / n + (0.0 if n_other is None else 1.0 / n_other))
