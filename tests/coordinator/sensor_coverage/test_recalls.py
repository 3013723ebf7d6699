"""A part of the swarm that is cut off from all stations: one of its robots is called back into sight of the others."""

from collections.abc import Collection

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.messages.commands import Arrived, ComeBack
from zwerm.coordinator.sensor_coverage.command_mailbox import Routine
from zwerm.coordinator.sensor_coverage.coordinator import SensorCoverageCoordinator
from zwerm.coordinator.sensor_coverage.push_execution import RECALLS_MAX, PushExecution
from zwerm.deploy.node_specs import node_specs
from zwerm.maths.simplicial import FlagComplex
from zwerm.scenario.load import load

ARRIVED = Arrived(0, True, False, False, 0.95, ())
# The station at slot 0 sees slot 1. Slots 2 and 3 see each other only.
PARTED = {0: [1], 1: [0], 2: [3], 3: [2]}
JOINED = {**PARTED, 1: [0, 2], 2: [1, 3]}


def pushing(neighbours: dict[int, list[int]], *settings: str) -> PushExecution:
    """Return the pushes of a coordinator whose robots 1 to 3 stand at the slots 1 to 3."""
    coordinator = Node(*node_specs(load("sensor-coverage", ("robots.count=4", *settings)), 1)[4])._controller
    assert isinstance(coordinator, SensorCoverageCoordinator)
    for robot in range(len(coordinator.slots.occupant), 4):
        coordinator.slots.add(robot)
    coordinator.pushing.scan = ScanResult({}, FlagComplex(neighbours), (0,))
    return coordinator.pushing


@pytest.mark.parametrize(
    ("neighbours", "settings", "calls"),
    [
        pytest.param(PARTED, (), 1, id="cut off"),
        pytest.param(JOINED, (), 0, id="joined"),
        pytest.param(PARTED, ('coordinator.parameters.walls="paper"',), 0, id="by the paper's rules"),
    ],
)
def test_a_robot_of_a_part_that_is_cut_off_is_called_back(
    neighbours: dict[int, list[int]], settings: tuple[str, ...], calls: int
) -> None:
    assert len(pushing(neighbours, *settings).recalls(())) == calls


def test_it_drives_until_it_sees_a_robot_of_another_part_and_gets_a_slot_there(monkeypatch: pytest.MonkeyPatch) -> None:
    sent = list[tuple[int, object]]()

    def arrivals(self: PushExecution, robots: Collection[int]) -> Routine[dict[int, Arrived]]:
        return dict.fromkeys(robots, ARRIVED)
        yield

    pushes = pushing(PARTED)
    monkeypatch.setattr(pushes._mailbox, "send", lambda robot, command, drive: sent.append((robot, command)))
    monkeypatch.setattr(PushExecution, "_arrivals", arrivals)
    (call,) = pushes.recalls((9,))
    with pytest.raises(StopIteration) as end:
        next(call)
    assert end.value.value == (3,)
    assert sent == [(3, ComeBack(pushes.cycle, (2, 3, 9)))]
    assert pushes._slots.slot_of()[3] > 3


def test_each_robot_is_called_back_a_few_times_only() -> None:
    pushes = pushing(PARTED)
    pushes._recalled[3] = RECALLS_MAX
    assert len(pushes.recalls(())) == 1, "the other one"
    pushes._recalled[2] = RECALLS_MAX
    assert not pushes.recalls(())
