"""The robot and the base station under a coordinator, where neighbours agree on which robot leaves the complex.

The coordinator requests a negotiation from robots that are not on the fence. Their neighbours only answer, and stand
still for them (`leave_lock`). The robots decide. A robot that has left reports that in each scan until it is commanded
to move. A command to move is never refused: it waits for the end of a lock.
"""

from collections.abc import Generator, Sequence
from typing import Final, TypeVar

import msgspec

from zwerm.agents.sensor_coverage.central_base import CentralBase
from zwerm.agents.sensor_coverage.central_robot import CentralRobot
from zwerm.agents.sensor_coverage.messages import peers
from zwerm.agents.sensor_coverage.messages.commands import (
    Correct,
    Deploy,
    LeftComplex,
    Move,
    NegotiateLeave,
    Report,
    RobotCommand,
    ScanRequest,
    Sighting,
)
from zwerm.agents.sensor_coverage.motion.homing import Vector
from zwerm.agents.sensor_coverage.motion.locomotion import STOP, Drive
from zwerm.agents.sensor_coverage.protocols.component import Component
from zwerm.agents.sensor_coverage.protocols.component_loop import Codec
from zwerm.agents.sensor_coverage.protocols.requested_leave import RequestedLeave
from zwerm.wire.messages import BodyVelocity, Command, Observation

T = TypeVar("T")

# A negotiation ends after this many ticks, or after this many failed attempts.
NEGOTIATION_TICKS_MAX: Final = 70
ATTEMPTS_MAX: Final = 2


class NegotiatingRobot(CentralRobot):
    """A robot that may leave the complex."""

    def _make_components(self) -> Sequence[Component]:
        self._leave = RequestedLeave(self.setup, self.random)
        return (*super()._make_components(), self._leave)

    def _make_codecs(self) -> dict[str, Codec]:
        return super()._make_codecs() | {peers.CHANNEL: Codec(peers.read, peers.write, in_envelopes=True)}

    def step(self, observation: Observation) -> Command:
        """Observe the neighbours, and step as a robot under a coordinator."""
        self._tick = observation.tick
        self._leave.observe(observation.tick, [each.node for each in observation.bearings or ()])
        command = super().step(observation)
        command.snapshot, self._leave.snapshot = self._leave.snapshot, b""
        return command

    def _advance(self) -> BodyVelocity:
        drive = super()._advance()
        if drive != STOP:
            self._leave.driven(self._tick)
        return drive

    # --- commands -----------------------------------------------------------------------------------------------------

    def _begin(self, command: RobotCommand) -> Drive | None:
        self._leave.wanted = self._leave.driving = False
        match command:
            case NegotiateLeave():
                return self._negotiate(command)
            case Deploy() | Move() | Correct():
                drive = super()._begin(command)
                return drive and self._once_unlocked(drive)
            case _:
                return super()._begin(command)

    def _negotiate(self, command: NegotiateLeave) -> Drive:
        """Leave if the neighbours agree, and report. No agreement holds after the report."""
        leave = self._leave
        leave.negotiation.begin()
        leave.wanted = not leave.has_left
        for _ in range(NEGOTIATION_TICKS_MAX):
            yield STOP
            if leave.has_left or leave.negotiation.stays or leave.negotiation.tries >= ATTEMPTS_MAX:
                break
        leave.wanted = False
        yield from self._scan(ScanRequest(command.cycle, ()))

    def _report(self, cycle: int, sightings: tuple[Sighting, ...] | None, home: bool) -> Report:
        report = super()._report(cycle, sightings, home)
        if not self._leave.has_left:
            return report
        return LeftComplex(*msgspec.structs.astuple(report))

    # --- standing still for a neighbour -------------------------------------------------------------------------------

    def _once_unlocked(self, drive: Drive) -> Drive:
        while self._leave.negotiation.locked:
            yield STOP
        self._leave.rejoin()
        yield from self._driving(drive)

    def _return_to_rest(self, rest: Vector) -> Generator[BodyVelocity, None, Vector]:
        if self._leave.negotiation.locked:
            return rest
        return (yield from self._driving(super()._return_to_rest(rest)))

    def _driving(self, drive: Generator[BodyVelocity, None, T]) -> Generator[BodyVelocity, None, T]:
        self._leave.driving = True
        try:
            return (yield from drive)
        finally:
            self._leave.driving = False


class NegotiatingBase(NegotiatingRobot, CentralBase):
    """The base station, which never leaves; robots beside it may."""
