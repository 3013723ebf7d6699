"""The base station: a robot that never moves, and lets the others out one by one when the coordinator asks."""

from typing import Final

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.central_robot import STOP, CentralRobot, Story
from zwerm.agents.sensor_coverage.messages.commands import Order, Release, Released
from zwerm.wire.messages import Command, Observation, Wake

# Who has not come out by then [ticks] will not.
BIRTH_TICKS: Final = 12
# A coordinator that has said nothing for so long is gone [s].
SILENCE_S: Final = 120.0


class CentralBase(CentralRobot):
    """A robot that never moves; its depot is its only actuator."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._releasing = False
        self._heard_s = 0.0

    def step(self, observation: Observation) -> Command:
        """Answer surveys, and release."""
        command = super().step(observation)
        command.drive = None
        command.release, self._releasing = self._releasing, False
        if observation.inbox:
            self._heard_s = observation.time_s
        elif observation.time_s > self._heard_s + SILENCE_S - 1e-9:
            self._heard_s = observation.time_s
            command.gave_up = f"coordinator-lost: not a word from the coordinator for {SILENCE_S:g} s"
        if command.wake is not None:
            command.wake = Wake(at_s=self._heard_s + SILENCE_S, on_packet=True)
        return command

    def _begin(self, order: Order) -> Story | None:
        return self._let_out() if isinstance(order, Release) else super()._begin(order)

    def _let_out(self) -> Story:
        """Let a robot out, and say who it is: the one who is in sight now and was not before."""
        before = self.senses.seen
        self._releasing = True
        born: int | None = None
        for _ in range(BIRTH_TICKS):
            yield STOP
            born = min((node for node in self.senses.seen if node not in before), default=None)
            if born is not None:
                break
        self._outbox.append(Released(born))
