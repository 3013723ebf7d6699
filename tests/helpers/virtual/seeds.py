"""The seeds of tests that explore schedules of failures."""

import os


def explored(count: int) -> range:
    """Return the first `count` seeds, or those that the variable SEEDS of the environment names as FIRST-LAST."""
    named = os.environ.get("SEEDS")
    if named is None:
        return range(count)
    first, last = map(int, named.split("-"))
    return range(first, last + 1)
