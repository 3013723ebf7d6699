"""The groups of robots that home again at the same time after a push."""

from hypothesis import given
from hypothesis import strategies as st

from zwerm.coordinator.sensor_coverage.push_execution import no_landmarks_of_each_other


def test_every_second_robot_of_a_single_file_homes_at_the_same_time() -> None:
    knows = {slot: [slot - 1, slot + 1] for slot in range(5)}
    assert no_landmarks_of_each_other(knows) == [0, 2, 4]


@given(edges=st.sets(st.tuples(st.integers(0, 9), st.integers(0, 9)).filter(lambda pair: pair[0] != pair[1])))
def test_robots_that_home_at_the_same_time_are_no_landmarks_of_each_other(edges: set[tuple[int, int]]) -> None:
    group = no_landmarks_of_each_other({slot: [b for a, b in edges if a == slot] for slot in range(10)})
    assert group[0] == 0
    assert not any(a in group and b in group for a, b in edges)
    # Each of the rest shares a landmark with the group, so no robot waits for nothing.
    beside = {slot: {a + b - slot for a, b in edges if slot in (a, b)} for slot in range(10)}
    assert all(beside[slot] & set(group) for slot in range(10) if slot not in group)
