"""The history keeps an even, bounded record of a run."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from zwerm.record.history import History


def moment(time_s: float, robots: int = 2) -> SimpleNamespace:
    position = np.full((robots, 2), time_s)
    return SimpleNamespace(
        time_s=time_s, position=position, heading=np.full(robots, -time_s), present=np.arange(robots) == 0
    )


@pytest.mark.parametrize("appended", [1, 2, 9, 10, 11, 12, 20, 21, 500, 1003])
def test_memory_is_bounded_and_the_samples_stay_even_from_first_to_newest(appended: int) -> None:
    history = History(held_max=10)
    for time in range(appended):
        history.append(moment(float(time)))
    times = history.arrays().time_s
    assert len(times) == len(history) <= 11
    assert times[0] == 0.0
    assert times[-1] == appended - 1
    steps = np.diff(times[:-1])
    assert (steps == steps[:1]).all()
    assert appended <= 10 or len(times) >= 5


def test_a_sample_is_a_copy_with_all_its_rows() -> None:
    history = History()
    now = moment(3.0, robots=4)
    history.append(now)
    now.position[:] = 99.0
    tracks = history.arrays()
    assert tracks.position.shape == (1, 4, 2)
    assert (tracks.position == 3.0).all()
    assert (tracks.heading == -3.0).all()
    assert tracks.present.tolist() == [[True, False, False, False]]


def test_samples_lie_in_a_few_blocks_so_that_thinning_leaves_no_holes_in_the_memory() -> None:
    history = History(held_max=100)
    history.append(moment(0.0, robots=50))
    tracemalloc.start()
    try:
        for time in range(1, 1_000):
            history.append(moment(float(time), robots=50))
        found = tracemalloc.take_snapshot().statistics("filename")
    finally:
        tracemalloc.stop()
    assert sum(each.count for each in found if each.traceback[0].filename.endswith("/history.py")) < 40


def test_an_empty_history_is_reported_as_empty() -> None:
    with pytest.raises(ValueError, match="empty"):
        History().arrays()
