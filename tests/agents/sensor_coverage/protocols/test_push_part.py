"""After which moves a follower homes again."""

import pytest

from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult
from zwerm.agents.sensor_coverage.neighbourhood.neighbour_table import NeighbourTable
from zwerm.agents.sensor_coverage.protocols.push_part import PushPart

ME, LEADER = 7, 8


class Here:
    """A robot behind the leader of a push."""

    node, clear = ME, True

    def __init__(self) -> None:
        self.tick = 0
        self.local_map = NeighbourTable(ME)
        self.bearings = dict[int, float]()
        self.dead = ()

    def part(self) -> PushPart:
        return PushPart(self, lambda _: None, 1, 9, ((3, ME), (4, LEADER)), 2)


@pytest.mark.parametrize(("noisy", "homes"), [(False, [True] * 5), (True, [False, True, False, True, False])])
def test_with_noise_a_robot_homes_again_after_every_second_move_by_odometry(noisy: bool, homes: list[bool]) -> None:
    here, found = Here(), []
    for _ in homes:
        part = here.part()
        part._note_move(DriveResult(True, used_odometry=True, used_moving_landmarks=True))
        found.append(part._homes_again(noisy))
    assert found == homes
    part._note_move(DriveResult(True))
    assert not part._homes_again(noisy)
    part._note_move(DriveResult(True, used_odometry=True, used_moving_landmarks=True))
    assert part._homes_again(noisy) is not noisy, "moves in between that landmarks determined begin anew"
