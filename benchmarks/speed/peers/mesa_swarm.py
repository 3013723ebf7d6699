"""The task in Mesa: an agent for each robot, in its continuous space. Kinematics only: no contacts, and walls as bounds."""

import math

import mesa
import numpy as np
from line_of_sight import DT_S, RADIUS_M, main, sees, side_m, starts, velocity
from mesa.space import ContinuousSpace


class Robot(mesa.Agent):
    """A robot that drives by its bit."""

    def __init__(self, model: mesa.Model, heading: float) -> None:
        super().__init__(model)
        self.heading = heading
        self.seen = False

    def drive(self) -> None:
        """Move by one tick, within the square."""
        forward, turn = velocity(self.seen)
        heading = self.heading + 0.5 * turn * DT_S
        x, y = self.pos
        low, high = RADIUS_M, self.model.side_m - RADIUS_M
        x = min(max(x + forward * DT_S * math.cos(heading), low), high)
        y = min(max(y + forward * DT_S * math.sin(heading), low), high)
        self.model.space.move_agent(self, (x, y))
        self.heading += turn * DT_S


class Swarm(mesa.Model):
    """The square and its robots."""

    def __init__(self, robots: int) -> None:
        super().__init__(seed=1)
        self.side_m = side_m(robots)
        self.space = ContinuousSpace(self.side_m, self.side_m, torus=False)
        for x, y, heading in starts(robots).tolist():
            self.space.place_agent(Robot(self, heading), (x, y))

    def step(self) -> None:
        """Sense all bits at once, and then move each robot."""
        robots = list(self.agents)
        places = np.array([robot.pos for robot in robots])
        bits = sees(places[:, 0], places[:, 1], np.array([robot.heading for robot in robots]))
        for robot, bit in zip(robots, bits.tolist(), strict=True):
            robot.seen = bit
        self.agents.do("drive")


if __name__ == "__main__":
    main(lambda robots: Swarm(robots).step)
