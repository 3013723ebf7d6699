"""The task in VMAS: discs with contacts that track a velocity, in WORLDS worlds at once on one core."""

from collections.abc import Callable

import torch
from line_of_sight import DT_S, RADIUS_M, main, side_m, starts, velocity
from vmas.simulator.core import Agent, Sphere, World

WORLDS = 32


def make(robots: int) -> Callable[[], object]:
    """Return what runs one tick of all worlds."""
    torch.set_num_threads(1)
    half_m = 0.5 * side_m(robots)
    world = World(WORLDS, torch.device("cpu"), dt=DT_S, substeps=10, x_semidim=half_m, y_semidim=half_m)
    poses = torch.tensor(starts(robots), dtype=torch.float32)
    for number in range(robots):
        world.add_agent(Agent(name=f"robot {number}", shape=Sphere(RADIUS_M)))
    for agent, pose in zip(world.agents, poses, strict=True):
        agent.set_pos((pose[:2] - half_m).expand(WORLDS, 2).clone(), batch_index=None)
        agent.set_rot(pose[2:].expand(WORLDS, 1).clone(), batch_index=None)
    speeds = torch.tensor([velocity(False), velocity(True)])
    itself = torch.eye(robots, dtype=torch.bool)

    def tick() -> None:
        place = torch.stack([agent.state.pos for agent in world.agents], dim=1)
        heading = torch.stack([agent.state.rot[:, 0] for agent in world.agents], dim=1)
        apart = place[:, None] - place[:, :, None]
        cos, sin = heading.cos()[..., None], heading.sin()[..., None]
        across, ahead = cos * apart[..., 1] - sin * apart[..., 0], cos * apart[..., 0] + sin * apart[..., 1]
        seen = ((across.abs() <= RADIUS_M) & (ahead > 0.0) & ~itself).any(dim=2).long()
        drive = speeds[seen]
        middle = heading + 0.5 * DT_S * drive[..., 1]
        for number, agent in enumerate(world.agents):
            forward, angle = drive[:, number, 0], middle[:, number]
            agent.set_vel(torch.stack([forward * angle.cos(), forward * angle.sin()], dim=1), batch_index=None)
            agent.set_ang_vel(drive[:, number, 1:], batch_index=None)
            agent.state.force = torch.zeros(WORLDS, 2)
            agent.state.torque = torch.zeros(WORLDS, 1)
        world.step()

    return tick


if __name__ == "__main__":
    main(make, WORLDS)
