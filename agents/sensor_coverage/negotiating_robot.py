"""The robot under a coordinator that agrees with its neighbours on who may leave the complex; and its base station.

The coordinator asks those who are not on the fence to find out; all others only answer their neighbours, and stand still for
them (`redundancy`). It is the robots that decide. Who has left stays where it is in body, and says so in all that it reports,
until it is ordered to move: then it is one of the complex again. An order to move is never refused: it waits for the
end of a lock.
"""

from collections.abc import Generator
from typing import Any, Final, TypeVar

import msgspec

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.central_base import CentralBase
from zwerm.agents.sensor_coverage.central_robot import STOP, CentralRobot, Story
from zwerm.agents.sensor_coverage.messages.commands import (
    Correct,
    Deploy,
    LeftComplex,
    Move,
    NegotiateLeave,
    Order,
    Report,
    ScanRequest,
)
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL, ListRequest, read, write
from zwerm.agents.sensor_coverage.motion.homing import Vector
from zwerm.agents.sensor_coverage.protocols import leave_lock as redundancy
from zwerm.agents.sensor_coverage.protocols.leave_negotiation import LeaveNegotiation
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission, Wake

T = TypeVar("T")

# How long to try to leave, how often in vain, and how long after its last drive a body is still [ticks].
CONFER_TICKS: Final = 70
TRIES_MAX: Final = 2
STILL_TICKS: Final = 2


class NegotiatingRobot(CentralRobot):
    """A robot that may leave the complex."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        newborn = setup.incarnation == 1
        self._leaving = LeaveNegotiation(setup.node, setup.dt_s, self.random, newborn)
        self._left = False
        self._seeks = False  # it is to leave if it can
        self._drives = False
        self._driven_at = 0
        self._told: dict[str, Any] = {} if newborn else {"removal": {"in": setup.node}}

    def step(self, observation: Observation) -> Command:
        """Answer the neighbours, go on with what the coordinator ordered, and leave if that was agreed upon."""
        tick, leaving = observation.tick, self._leaving
        leaving.watch(tick, [each.node for each in observation.bearings or ()])
        leaving.note(self._stands(tick))
        orders = []
        for packet in observation.inbox:
            if packet.channel != CHANNEL:
                orders.append(packet)
                continue
            word = read(packet.payload)
            if packet.sender is not None and isinstance(word, redundancy.Message | ListRequest):
                leaving.hear(packet.sender, word)
        command = super().step(msgspec.structs.replace(observation, inbox=tuple(orders)))
        if command.drive is not None and command.drive != STOP:
            self._driven_at = tick
        leaving.note(self._stands(tick))
        if leaving.turn(self._seeks):
            self._left, self._told = True, {"removal": {"out": self.setup.node}}
            leaving.note(stands=False)
        words = tuple(Transmission(CHANNEL, write(word), to) for to, word in leaving.letters())
        command.outbox += words
        command.wake = self._sooner(command.wake, tick)
        command.told, self._told = self._told, {}
        return command

    def _stands(self, tick: int) -> bool:
        return not (self._left or self._drives or tick <= self._driven_at + STILL_TICKS)

    def _sooner(self, wake: Wake | None, tick: int) -> Wake | None:
        """Return a wake that is not later than the neighbours need it."""
        due = self._leaving.next_tick()
        if wake is None or due is None:
            return wake
        at_s = max(tick + 1, due) * self.setup.dt_s
        return Wake(at_s=at_s if wake.at_s is None else min(at_s, wake.at_s), on_packet=True)

    # --- orders -----------------------------------------------------------------------------------------------------

    def _begin(self, order: Order) -> Story | None:
        self._seeks = self._drives = False
        match order:
            case NegotiateLeave():
                return self._confer(order)
            case Deploy() | Move() | Correct():
                story = super()._begin(order)
                return story and self._once_unlocked(story)
            case _:
                return super()._begin(order)

    def _confer(self, order: NegotiateLeave) -> Story:
        """Leave, if the neighbours agree; nothing that was agreed upon holds after the answer."""
        self._leaving.begin()
        self._seeks = not self._left
        for _ in range(CONFER_TICKS):
            yield STOP
            if self._left or self._leaving.stays or self._leaving.tries >= TRIES_MAX:
                break
        self._seeks = False
        yield from self._survey(ScanRequest(order.cycle, ()))

    def _survey(self, order: ScanRequest) -> Story:
        yield from super()._survey(order)
        report = self._outbox[-1]
        if self._left and isinstance(report, Report):
            self._outbox[-1] = LeftComplex(report.cycle, report.sightings, report.touched, report.home)

    # --- standing still for others ----------------------------------------------------------------------------------

    def _once_unlocked(self, drive: Story) -> Story:
        while self._leaving.locked:
            yield STOP
        if self._left:
            self._left, self._told = False, {"removal": {"in": self.setup.node}}
        yield from self._driving(drive)

    def _return(self, rest: Vector) -> Generator[BodyVelocity, None, Vector]:
        if self._leaving.locked:
            return rest
        return (yield from self._driving(super()._return(rest)))

    def _driving(self, drive: Generator[BodyVelocity, None, T]) -> Generator[BodyVelocity, None, T]:
        self._drives = True
        end = yield from drive
        self._drives = False
        return end


class NegotiatingBase(NegotiatingRobot, CentralBase):
    """The base station: it never leaves, but those beside it may."""
