"""The task in IR-SIM: differential robots as discs, without display. Robots are not obstructed, and there are no walls."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import irsim
import numpy as np
from line_of_sight import DT_S, RADIUS_M, main, sees, side_m, starts, velocity


def make(robots: int) -> Callable[[], object]:
    """Return what runs one tick."""
    size_m = side_m(robots)
    lines = [
        f"world: {{height: {size_m}, width: {size_m}, step_time: {DT_S}, sample_time: {DT_S}, collision_mode: unobstructed}}",
        "robot:",
    ]
    for x, y, heading in starts(robots).tolist():
        lines += [
            "  - kinematics: {name: diff}",
            f"    shape: {{name: circle, radius: {RADIUS_M}}}",
            f"    state: [{x}, {y}, {heading}]",
            "    vel_min: [-0.2, -10.0]",
            "    vel_max: [0.2, 10.0]",
        ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "world.yaml"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        world = irsim.make(str(path), display=False, disable_all_plot=True, log_level="ERROR")
    commands = [np.array(velocity(bit)).reshape(2, 1) for bit in (False, True)]

    def tick() -> None:
        poses = np.array([robot.state[:3, 0] for robot in world.robot_list])
        bits = sees(poses[:, 0], poses[:, 1], poses[:, 2])
        world.step([commands[bit] for bit in bits.tolist()])

    return tick


if __name__ == "__main__":
    main(make)
