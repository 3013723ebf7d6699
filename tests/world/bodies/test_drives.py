"""Drives: the kinematics of built-in bodies and of a user's own."""

import numpy as np
import pytest

import zwerm
from zwerm.catalogue import DRIVES
from zwerm.errors import ScenarioError
from zwerm.scenario.tables import BodyTable
from zwerm.world.bodies.drives import find_drive


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
