"""Drives: the kinematics of built-in bodies and of a user's own."""

import numpy as np
import pytest
from msgspec.structs import astuple

import zwerm
from zwerm.catalogue import DRIVES
from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import BodyTable
from zwerm.world.bodies.drives import Drives, find_drive


@pytest.mark.parametrize("kind", sorted(DRIVES))
def test_a_built_in_drive_keeps_to_the_limits_of_the_motors(kind: str) -> None:
    body = BodyTable(kind=kind, max_speed_m_s=0.1, max_turn_rad_s=1.0, wheel_base_m=0.05)
    drive = find_drive(kind)(body)
    axes = len(drive.command.__struct_fields__)
    random = np.random.Generator(np.random.Philox(3))
    forward, left, turn = drive.velocities(random.uniform(-5.0, 5.0, (200, axes)))
    speed = np.hypot(forward, 0.0 if left is None else left)
    assert speed.max() <= 0.1 + 1e-12
    assert np.abs(turn).max() <= (4.0 if drive.has_wheels else 1.0) + 1e-12


def test_a_differential_drive_turns_by_the_difference_of_its_wheels() -> None:
    drive = find_drive("differential")(BodyTable(max_speed_m_s=1.0, wheel_base_m=0.1))
    forward, left, turn = drive.velocities(np.array([[0.2, 0.4], [0.3, 0.3]]))
    assert left is None
    assert forward == pytest.approx([0.3, 0.3])
    assert turn == pytest.approx([2.0, 0.0])


@pytest.mark.parametrize("kind", sorted(DRIVES))
@pytest.mark.parametrize("latency_ticks", [0, 1])
def test_velocities_that_last_are_those_of_the_newest_commands(kind: str, latency_ticks: int) -> None:
    body = BodyTable(kind=kind, max_speed_m_s=0.1, max_turn_rad_s=1.0, wheel_base_m=0.05, latency_ticks=latency_ticks)
    count, random = 40, np.random.Generator(np.random.Philox(5))
    drives, whole = Drives(body, count, Draws(1)), find_drive(kind)(body)
    axes = len(whole.command.__struct_fields__)
    commanded = np.zeros((count, axes))
    same, before = 0, None
    for _ in range(300):
        some = random.choice(count, int(random.choice([0, 1, 3, 30])), replace=False).tolist()
        orders = {robot: whole.command(*random.choice([0.0, 0.05, 0.2], axes).tolist()) for robot in some}
        if orders:
            drives.command(orders)
        for robot, order in orders.items():
            commanded[robot] = astuple(order)
        if random.random() < 0.1:
            drives.stop(7)
            commanded[7] = 0.0
        found = drives.velocities(0)
        for part, expected in zip(found, whole.velocities(commanded), strict=True):
            assert (part is None) == (expected is None)
            assert part is None or part.tolist() == expected.tolist()
        same += found is before
        before = found
    assert same > 30  # the control: some of them are kept


def test_a_drive_of_a_users_own_moves_the_robots_of_a_run() -> None:
    settings = ["time.duration_s=5", "robots.count=3"]
    plain = zwerm.run("computation-free", runner="inline", overrides=settings)
    tracked = zwerm.run(
        "computation-free", runner="inline", overrides=[*settings, "robots.body.kind=own_drives:Tracked"]
    )
    assert tracked.outcome == "time-limit"
    assert tracked.trace != plain.trace


@pytest.mark.parametrize(
    ("kind", "line"),
    [
        ("legs", f"expected a built-in drive ({', '.join(DRIVES)}) or module:Class, got 'legs'"),
        ("own_drives:NoCommand", "own_drives:NoCommand is no drive: expected a subclass of zwerm.Drive"),
    ],
)
def test_a_body_without_a_drive_is_one_line(kind: str, line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        zwerm.run("computation-free", runner="inline", overrides=[f"robots.body.kind={kind}"])
    [mistake] = caught.value.mistakes
    assert "robots.body.kind: " + line in mistake
