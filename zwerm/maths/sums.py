"""Sums of floats that are the same in every version of Python."""

import operator
from collections.abc import Iterable
from functools import reduce


def added(values: Iterable[float]) -> float:
    """Return the sum of `values`, added one after the other; 0.0 without values.

    Python's own `sum` compensates the rounding of floats since 3.12, so its last bits, and with them the traces of runs,
    depend on the version of Python.
    """
    return reduce(operator.add, values, 0.0)
