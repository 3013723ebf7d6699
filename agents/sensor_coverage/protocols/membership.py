"""Whether a robot is one of the complex: it leaves by agreement among neighbours, offers itself, and comes back with a push.

A robot that has left stands where it stood: it is nobody's neighbour, and still everybody's landmark. The base calls it to
be the rear of a push, which brings it to the next place ahead, and a robot into the unknown, without another one let out. So
nobody is lost or counted twice: it has its place until it leaves, none until it is called, and then that of the robot ahead.
"""

from collections.abc import Collection
from typing import Any, Protocol

import numpy as np

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.frontier.exposure import opens
from zwerm.agents.sensor_coverage.frontier.fence import wedges
from zwerm.agents.sensor_coverage.frontier.services import ScanResult
from zwerm.agents.sensor_coverage.messages.advice import CHANNEL as UPLINK
from zwerm.agents.sensor_coverage.messages.advice import StandingReport
from zwerm.agents.sensor_coverage.messages.peers import (
    NOWHERE,
    Body,
    Errand,
    ListRequest,
    RedundantCall,
    RedundantOffer,
    RedundantPushEnd,
    Word,
)
from zwerm.agents.sensor_coverage.protocols import leave_lock as redundancy
from zwerm.agents.sensor_coverage.protocols.advice_client import AdviceClient
from zwerm.agents.sensor_coverage.protocols.leave_negotiation import LeaveNegotiation
from zwerm.agents.sensor_coverage.protocols.redundant_pool import PoolHost, RedundantPool
from zwerm.agents.sensor_coverage.protocols.token_push import TokenPush
from zwerm.maths.simplicial import may_leave
from zwerm.wire.messages import Packet, Transmission


class ComplexMember(PoolHost, Protocol):
    """The robot that stays or leaves."""

    push: TokenPush | None
    drives: bool


class Membership:
    """One robot's part. Where nobody finds who can be spared nobody leaves, and all of it does nothing."""

    def __init__(self, robot: ComplexMember, setup: Setup, random: np.random.Generator) -> None:
        self._robot = robot
        self._leaving: LeaveNegotiation | None = None
        self._counsel: AdviceClient | None = None
        if setup.services.get("redundancy") in ("link", "coordinator"):
            self._leaving = LeaveNegotiation(setup.node, setup.dt_s, random, setup.incarnation == 1)
        if setup.services.get("redundancy") == "coordinator":
            self._counsel = AdviceClient(setup.dt_s)
        self._fenced: tuple[object, tuple[int, ...]] = None, ()
        self._reserve = RedundantPool(robot)
        self._known: tuple[object, bool] = None, False
        self._out = False

    @property
    def locked(self) -> bool:
        """Whether the robot has to stand still."""
        return self._leaving is not None and self._leaving.locked

    def watch(self, sight: Collection[int]) -> None:
        """Take in whom the robot sees; first in every tick."""
        if self._leaving is not None:
            self._leaving.watch(self._robot.tick, sight)

    def hear(self, sender: int, word: redundancy.Message | ListRequest) -> None:
        """Take in what another robot says of leaving."""
        if self._leaving is not None:
            self._leaving.note(self._stands)
            self._leaving.hear(sender, word)

    def advise(self, packet: Packet) -> None:
        """Take in what a coordinator says."""
        if self._counsel is not None and packet.channel == UPLINK:
            self._counsel.hear(self._robot.tick, packet.payload)

    def read(self, errand: Errand) -> None:
        """Take in a letter between the base and a robot that has left."""
        self._reserve.read(errand)

    def lost(self, body: Body) -> None:
        """A letter was never acknowledged."""
        if isinstance(body, RedundantOffer | RedundantCall | RedundantPushEnd):
            self._reserve.lost(body)

    def over(self, push: TokenPush) -> None:
        """A push is over that the robot was part of."""
        self._reserve.over(push)

    def turn(self, sight: Collection[int]) -> dict[str, Any]:
        """Go on, and return what is to be told to those who watch."""
        if self._leaving is None:
            return {}
        told: dict[str, Any] = {}
        vicinity = self._robot.vicinity
        self._leaving.note(self._stands)
        versions = None
        if self._counsel is not None and self._leaving.told is not None:
            versions = self._counsel.verdict(self._robot.tick, self._leaving.told.listed)
        if self._leaving.turn(self._redundant(sight, told=versions is not None), versions):
            vicinity.stand_down()
            self._leaving.note(stands=False)
            self._out, told = True, {"removal": {"out": self._robot.node}}
        elif self._out and not vicinity.spare:
            self._out, told = False, {"removal": {"in": self._robot.node}}
        self._reserve.turn()
        if self._counsel is not None:
            self._counsel.note(self._robot.tick, self._standing())
        return told

    def letters(self) -> list[tuple[int | None, Word]]:
        """Return what is to be sent now to robots, with whom it is for (None: all that hear it)."""
        return self._leaving.letters() if self._leaving is not None else []

    def uplink(self) -> list[Transmission]:
        """Return what is to be sent now to a coordinator."""
        return [] if self._counsel is None else [Transmission(UPLINK, each) for each in self._counsel.letters()]

    def next_ticks(self) -> list[int]:
        """Return when to be looked after, at the latest."""
        if self._leaving is None:
            return []
        times = [each for each in (self._leaving.next_tick(), self._reserve.next_tick()) if each is not None]
        return times if self._counsel is None else [*times, *self._counsel.next_ticks()]

    @property
    def _stands(self) -> bool:
        """Whether it is one of those who stand, at its place or the base's, and has nothing else to do."""
        robot, vicinity = self._robot, self._robot.vicinity
        return not (vicinity.spare or vicinity.moving or robot.drives) and robot.push is None

    def _redundant(self, sight: Collection[int], told: bool) -> bool:
        """Tell whether coverage would not miss it, and somebody is wanted at the frontier.

        Where there is a coordinator it says so or nobody does: it is `told`, and need not find out what makes it safe.
        """
        robot, vicinity = self._robot, self._robot.vicinity
        if vicinity.place in (0, NOWHERE) or not (self._stands and vicinity.leads and robot.clear):
            return False
        mutual = vicinity.mutual()
        others = [vicinity.states.get(node) for node in sight if node not in mutual]
        if vicinity.plans or vicinity.gaps or not all(each is not None and each.waiting for each in others):
            return False
        if self._counsel is not None and not told:
            return False
        if self._known[0] is not vicinity.looked:
            margin_rad = vicinity.rules.corner_margin_rad
            judge = is_within if told else can_be_spared
            self._known = vicinity.looked, judge(vicinity.picture(), vicinity.place, margin_rad)
        return self._known[1]

    def _standing(self) -> StandingReport | None:
        """Return how the robot stands, for a coordinator; None as long as it has not found out."""
        vicinity, told = self._robot.vicinity, self._leaving.told if self._leaving is not None else None
        if told is None or not (self._stands or vicinity.spare):
            return None
        if vicinity.place == NOWHERE or vicinity.spare:
            return StandingReport(0, told.version, told.listed, (), not vicinity.spare, False)
        looked = vicinity.looked
        if looked is None:
            return None
        if self._fenced[0] is not looked:
            self._fenced = looked, tuple(sorted(n for p in vicinity.rim() if (n := vicinity.at(p)) is not None))
        missed = self._known[0] is looked and not self._known[1]
        willing = vicinity.place != 0 and not (vicinity.plans or vicinity.gaps or missed)
        return StandingReport(0, told.version, told.listed, self._fenced[1], True, willing)


def can_be_spared(picture: ScanResult, place: int, corner_margin_rad: float) -> bool:
    """Tell whether a place can be left: it is within what is covered, and the link criterion holds."""
    linked = _surrounded(picture, place) and may_leave(place, picture.complex_.neighbours)
    return linked and not opens(picture, place, corner_margin_rad)


def is_within(picture: ScanResult, place: int, corner_margin_rad: float) -> bool:
    """Tell whether a place is within what is covered, and would be if it were left."""
    return _surrounded(picture, place) and not opens(picture, place, corner_margin_rad)


def _surrounded(picture: ScanResult, place: int) -> bool:
    """Tell whether a place has triangles all around."""
    views, complex_, _ = picture
    return bool(complex_.neighbours[place]) and not any(True for _ in wedges(views, complex_, [place]))
