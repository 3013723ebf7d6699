"""After which moves a follower homes again, and when."""

import msgspec
import pytest

from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, StateBeacon
from zwerm.agents.sensor_coverage.messages.pushes import SlotMemory
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult
from zwerm.agents.sensor_coverage.neighbourhood.neighbour_table import NeighbourTable
from zwerm.agents.sensor_coverage.protocols.push_part import PushPart

BEHIND, ME, LEADER = 6, 7, 8


class Here:
    """A robot behind the leader of a push."""

    node, clear = ME, True

    def __init__(self) -> None:
        self.tick = 0
        self.local_map = NeighbourTable(ME)
        self.bearings = dict[int, float]()
        self.dead = ()

    def part(self, even: bool = True) -> PushPart:
        """Return its part in a push in which its place in the chain is even, or odd."""
        chain = ((1, 5), (2, BEHIND), (3, ME), (4, LEADER))
        return PushPart(self, lambda _: None, 1, 9, chain if even else chain[1:], 2)


@pytest.mark.parametrize(
    ("noisy", "even", "homes"),
    [(False, False, [True] * 5), (True, True, [True] * 5), (True, False, [False, True, False, True, False])],
)
def test_with_noise_a_robot_homes_again_at_even_places_and_after_every_second_move_by_odometry(
    noisy: bool, even: bool, homes: list[bool]
) -> None:
    here, found = Here(), []
    for _ in homes:
        part = here.part(even)
        part._note_move(DriveResult(True, used_odometry=True, used_moving_landmarks=True))
        found.append(part._homes_again(noisy))
        if found[-1]:
            here.local_map.odometry_moves = 0
    assert found == homes
    part._note_move(DriveResult(True))
    assert not part._homes_again(noisy)
    part._note_move(DriveResult(True, used_odometry=True, used_moving_landmarks=True))
    due = even or not noisy
    assert part._homes_again(noisy) is due, "moves in between that landmarks determined begin anew"


def test_every_second_robot_homes_before_those_behind_have_once_the_one_behind_stands() -> None:
    here = Here()
    moved, straight = DriveResult(True, used_moving_landmarks=True), DriveResult(True)

    def homes(even: bool = True, noisy: bool = True, result: DriveResult = moved, **behind: object) -> bool:
        state = StateBeacon(1, 3, 0, False, False, 1, (), (), (), NO_PATH_VECTOR)
        here.local_map.states[BEHIND] = msgspec.structs.replace(state, **behind)
        part = here.part(even)
        part._note_move(result)
        assert not part._homes_early(noisy), "it does not know the slot yet"
        part._memory = SlotMemory(4, (), (), (), (), (), ())
        return part._homes_early(noisy)

    assert homes()
    assert not homes(moving=True), "it is on its way"
    assert not homes(slot=2), "it has not left its own slot"
    assert not homes(even=False)
    assert not homes(noisy=False), "without noise homing is short"
    assert not homes(result=straight), "its landmarks stood"
    assert not homes(result=moved._replace(used_odometry=True)), "its distance is corrected first"
    here.local_map.distances_m[3] = 0.5
    assert not homes(), "a walk has measured its distance"


def test_a_robot_that_does_not_drive_again_stands_for_those_that_home() -> None:
    here = Here()
    part = here.part(even=False)
    part._note_move(DriveResult(True, used_moving_landmarks=True))
    assert part._stays()
    part._note_move(DriveResult(True, used_odometry=True))
    assert not part._stays()
    even = here.part()
    even._note_move(DriveResult(True, used_moving_landmarks=True))
    assert not even._stays()
