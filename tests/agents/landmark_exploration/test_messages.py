"""Messages fit into small packets, and the receiver joins the parts in any order of arrival."""

import itertools
import random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.frontier_status import BOUNDARY, key_of
from zwerm.agents.landmark_exploration.mapping.landmark_map import LandmarkMap
from zwerm.agents.landmark_exploration.mapping.map_file import map_of_reports, read_map, write_map
from zwerm.agents.landmark_exploration.mapping.map_reports import MapReport, write_report
from zwerm.agents.landmark_exploration.sharing import landmark_messages as messages
from zwerm.agents.landmark_exploration.sharing import log_entries as entries
from zwerm.agents.landmark_exploration.sharing.exploration_tasks import (
    ExplorationTask,
    TaskIntake,
    cut,
    landmark_bytes,
    landmarks_in,
    read_task,
    write_task,
)
from zwerm.agents.landmark_exploration.sharing.landmark_messages import TaskReport, Vector
from zwerm.agents.landmark_exploration.sharing.packing import counts_of, pack_entries, pack_vector
from zwerm.agents.landmark_exploration.sharing.replica import Replica, Stretch
from zwerm.agents.landmark_exploration.sharing.upload import RETRY_TICKS, Upload

ids = st.integers(0, 65_535)
snapshots = st.dictionaries(ids, st.integers(0, 255), max_size=20).map(
    lambda pairs: BearingSnapshot(tuple(sorted(pairs)), tuple(pairs[each] for each in sorted(pairs)))
)


# A loaded machine may draw the first examples slowly.
@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(snapshots, max_size=3), st.integers(0, 200_000))
def test_a_log_holds_all_observations_in_packets_of_any_size(some: list[BearingSnapshot], origin: int) -> None:
    log = tuple(entry for each in some for entry in entries.observation_entries(each))
    assert all(len(entry) <= entries.ENTRY_BYTES_MAX for entry in log)
    direct, packed = LandmarkMap(), LandmarkMap()
    direct.read(Stretch(origin, 0, log), 0)
    for size in (messages.SMALL_BYTES, messages.LARGE_BYTES):
        held = 0
        for message in pack_entries(Stretch(origin, 0, log), size):
            packet = messages.write(message)
            assert len(packet) <= size
            assert messages.read(packet) == message
            packed.read(Stretch(message.origin, message.first, message.entries), message.first)
            held += len(message.entries)
        assert held == len(log)
        assert packed.content() == direct.content()
    assert set(direct.complex.table) == {each.landmarks for each in some if each.landmarks}


@given(st.dictionaries(st.integers(0, 2**31), st.integers(1, 2**31), max_size=40), st.sampled_from([64, 1_000]))
def test_a_vector_in_parts_names_every_origin_once(vector: dict[int, int], size: int) -> None:
    parts = pack_vector(vector, size, ask=True)
    assert all(len(messages.write(part)) <= size for part in parts)
    assert {origin: count for part in parts for origin, count in counts_of(part).items()} == vector
    assert parts[0].low == 0
    assert all(one.high == other.low for one, other in itertools.pairwise(parts))


tasks = st.builds(
    ExplorationTask,
    st.tuples(ids, ids).filter(lambda pair: pair[0] != pair[1]).map(lambda pair: key_of(*pair)),
    st.lists(snapshots, max_size=4).map(tuple),
    st.integers(1, 6),
    st.just(False),
)


@given(tasks, st.randoms(), st.sampled_from([64, 1_000]))
def test_a_task_is_joined_from_parts_in_any_order(task: ExplorationTask, order: random.Random, size: int) -> None:
    assert read_task(write_task(task)) == task
    parts = cut(write_task(task), 3, 1, 9, size)
    assert all(len(messages.write(part)) <= size for part in parts)
    shuffled = [*parts, *parts]
    order.shuffle(shuffled)
    intake = TaskIntake(1)
    found = [each for each in map(intake.accept, shuffled) if each is not None]
    assert found == [task]
    assert intake.newest == (3, 9)


def test_late_parts_of_an_older_task_are_ignored() -> None:
    intake = TaskIntake(1)
    (old,) = cut(write_task(ExplorationTask(key_of(1, 2))), 1, 1, 4, 64)
    (new,) = cut(write_task(ExplorationTask(key_of(3, 4))), 1, 1, 5, 64)
    (later_incarnation,) = cut(write_task(ExplorationTask(None)), 2, 1, 1, 64)
    (other_robot,) = cut(write_task(ExplorationTask(None)), 2, 2, 1, 64)
    assert intake.accept(new) == ExplorationTask(key_of(3, 4))
    assert intake.accept(old) is None
    assert intake.accept(other_robot) is None
    assert intake.accept(later_incarnation) == ExplorationTask(None)
    assert intake.accept(new) is None


@pytest.mark.parametrize("content", [b"", b"1234", b"\1\0\2\0\2\3\1\0\0"])
def test_bytes_that_encode_no_task_are_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match=r"a task|a vertex"):
        read_task(content)


@pytest.mark.parametrize("entry", [b"", b"\1\0", b"\7\0\0\0", b"\2", b"\2\0\1\0\2\0", b"\2\7\1\0\2\0"])
def test_invalid_entries_change_nothing(entry: bytes) -> None:
    map_, empty = LandmarkMap(), LandmarkMap()
    map_.read(Stretch(1, 0, (entry,)), 0)
    assert map_.content() == empty.content()


def test_a_report_is_small() -> None:
    report = TaskReport(255, 2**16, 2**16, True, True, 2**31, landmark_bytes(range(60_000, 60_040)))
    assert len(messages.write(report)) <= messages.SMALL_BYTES
    assert landmarks_in(landmark_bytes((5, 3))) == (3, 5)


def test_a_damaged_packet_is_ignored() -> None:
    packet = bytearray(messages.write(Vector(0, 9, (1, 2), True)))
    packet[6] ^= 1
    assert messages.read(bytes(packet)) is None


def test_an_upload_begins_again_for_a_coordinator_that_lost_its_memory() -> None:
    replica = Replica()
    upload = Upload(replica, 7, 64)
    replica.append(7, [b"a", b"b"])
    (first,) = upload.tick(1)
    assert first.entries == (b"a", b"b")
    assert not list(upload.tick(2))
    (again,) = upload.tick(1 + RETRY_TICKS)
    assert again == first
    upload.acknowledge(Vector(7, 8, (7, 2), False))
    assert upload.complete
    assert not list(upload.tick(100))
    upload.acknowledge(Vector(7, 8, (), False))
    assert not upload.complete
    assert list(upload.tick(200)) == [first]


def test_a_map_survives_its_file() -> None:
    map_ = LandmarkMap()
    map_.observe(BearingSnapshot((1, 2, 3), (0, 90, 180)))
    map_.observe(BearingSnapshot((2, 3, 4), (10, 100, 190)))
    map_.raise_all([key_of(3, 2)], BOUNDARY)
    again = read_map(write_map(map_))
    assert again.content() == map_.content()
    report = write_report(MapReport(((1, 2, 3),), ((0, 90, 180),), open=3))
    assert map_of_reports([b"nothing", report]).complex.table == {(1, 2, 3): (0, 90, 180)}


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "no landmark map: "),
        ("{}", "no landmark map: "),
        ('{"format":"x","observations":[]}', "expected the format 'landmark-map/1', got 'x'"),
        ('{"format":"landmark-map/1","observations":[[[1,2],[3]]]}', "observation 0 has 2 landmarks, 1 bearings"),
        ('{"format":"landmark-map/1","observations":[[[1],[300]]]}', "no landmark map: "),
        (
            '{"format":"landmark-map/1","observations":[[[2,2],[1,3]]]}',
            "observation 0: expected ascending ids, got [2, 2]",
        ),
    ],
)
def test_a_file_that_holds_no_map_is_refused_in_one_line(text: str, line: str) -> None:
    with pytest.raises(ValueError, match="no landmark map") as error:
        read_map(text)
    assert line in str(error.value)
    assert "\n" not in str(error.value)
