"""The base station: a robot that never moves, and lets the others out one by one when the coordinator asks."""

from zwerm.agents.contract import Setup
from zwerm.agents.sensor_coverage.robot import Robot, Story
from zwerm.orders import Order, Release, Survey
from zwerm.protocol import Command, Observation


class Base(Robot):
    """A robot that never moves; its depot is its only actuator."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._releasing = False

    def step(self, observation: Observation) -> Command:
        """Answer surveys, and release."""
        command = super().step(observation)
        command.drive = None
        command.release, self._releasing = self._releasing, False
        return command

    def _begin(self, order: Order) -> Story | None:
        if isinstance(order, Release):
            self._releasing = True
        return self._survey(order) if isinstance(order, Survey) else None
