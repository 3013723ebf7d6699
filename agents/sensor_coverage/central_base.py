"""The base station under a coordinator: it never moves, and releases robots from its depot on command."""

from typing import Final

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.central_robot import CentralRobot
from zwerm.agents.sensor_coverage.messages.commands import UPLINK, Release, Released, RobotCommand
from zwerm.agents.sensor_coverage.motion.locomotion import STOP, Drive
from zwerm.wire.messages import Command, Observation, Wake

# A released robot that is not visible after this many ticks does not come out.
RELEASE_TICKS_MAX: Final = 12
# The coordinator counts as lost after this silence.
SILENCE_S_MAX: Final = 120.0


class CentralBase(CentralRobot):
    """A robot that never moves; its depot is its only actuator."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._release = False
        self._heard_s = 0.0

    def step(self, observation: Observation) -> Command:
        """Answer scan requests, release robots, and give up when the coordinator is lost."""
        command = super().step(observation)
        command.drive = None
        command.release, self._release = self._release, False
        if any(packet.channel == UPLINK for packet in observation.inbox):
            self._heard_s = observation.time_s
        elif observation.time_s > self._heard_s + SILENCE_S_MAX - 1e-9:
            self._heard_s = observation.time_s
            command.gave_up = f"coordinator-lost: no message from the coordinator for {SILENCE_S_MAX:g} s"
        if command.wake is not None:
            command.wake = self._before_silence(command.wake)
        return command

    def _before_silence(self, wake: Wake) -> Wake:
        """Return a wake-up that is no later than the end of the permitted silence."""
        at_s = self._heard_s + SILENCE_S_MAX
        return Wake(at_s=at_s if wake.at_s is None else min(at_s, wake.at_s), on_packet=True)

    def _begin(self, command: RobotCommand) -> Drive | None:
        return self._let_out() if isinstance(command, Release) else super()._begin(command)

    def _let_out(self) -> Drive:
        """Release a robot, and report it: the robot that is visible now and was not before."""
        before = self.motion.frame.seen
        self._release = True
        released: int | None = None
        for _ in range(RELEASE_TICKS_MAX):
            yield STOP
            released = min((node for node in self.motion.frame.seen if node not in before), default=None)
            if released is not None:
                break
        self.commands.answer(Released(released))
