"""Membership in the complex: a robot leaves by agreement among neighbours, and comes back with a push.

A robot that has left stays where it stood: it is no neighbour of any robot, and still a landmark for all. The base
calls it to be the rear of a push, which brings it to the next slot ahead and another robot into unknown space. So no
robot is lost or counted twice. It has its slot until it leaves, and none until it is called. Then it has the slot of
the robot ahead.
"""

from typing import Any, ClassVar

from zwerm.agents.sensor_coverage.frontier.exposure import opens
from zwerm.agents.sensor_coverage.frontier.fence import wedges
from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.messages.advice import StandingReport
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.messages.snapshots import MembershipSnapshot, encode_snapshot
from zwerm.agents.sensor_coverage.neighbourhood.situation import Situation
from zwerm.agents.sensor_coverage.protocols.advice_client import AdviceClient
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.agents.sensor_coverage.protocols.leave_negotiation import LeaveNegotiation
from zwerm.maths.simplicial import may_leave


class Membership(Component):
    """One robot's part. With an `advice_client` a coordinator decides which robots are redundant, else each robot does."""

    channel: ClassVar[str] = CHANNEL
    accepts: ClassVar[tuple[type, ...]] = LeaveNegotiation.accepts

    def __init__(
        self, situation: Situation, negotiation: LeaveNegotiation, advice_client: AdviceClient | None = None
    ) -> None:
        self._situation = situation
        self._negotiation = negotiation
        self._advice_client = advice_client
        self._judged: tuple[object, bool] = None, False  # basis of plans, whether the robot is redundant by it
        self._fenced: tuple[object, tuple[int, ...]] = None, ()  # basis of plans, robots at boundary edges by it
        self._left = situation.incarnation > 1  # a former incarnation may have left, and not reported it

    def receive(self, sender: int, message: Any, tick: int) -> None:
        """Take in a message about neighbour lists and locks."""
        self._negotiation.update(self._situation.stands)
        self._negotiation.receive(sender, message, tick)

    def is_idle(self, tick: int) -> bool:
        """Return False: locks end at times of their own."""
        return False

    def poll(self, tick: int) -> None:
        """Go on with the negotiation, and leave the complex once all neighbours have agreed."""
        situation, negotiation, local_map = self._situation, self._negotiation, self._situation.local_map
        negotiation.update(situation.stands)
        negotiation.versions = None
        if self._advice_client is not None and negotiation.neighbour_list is not None:
            negotiation.versions = self._advice_client.advice(tick, negotiation.neighbour_list.listed)
        negotiation.wanted = self._redundant(advised=negotiation.versions is not None)
        negotiation.poll(tick)
        if negotiation.left:
            local_map.leave_complex()
            negotiation.update(stands=False)
            self._left = True
            situation.snapshot = encode_snapshot(MembershipSnapshot(False))
        elif self._left and not local_map.redundant:
            self._left = False
            situation.snapshot = encode_snapshot(MembershipSnapshot(True))
        if self._advice_client is not None:
            self._advice_client.update(tick, self._report())

    def outgoing(self) -> list[Outgoing]:
        """Return the messages of the negotiation."""
        return self._negotiation.outgoing()

    def next_wake(self) -> int | None:
        """Return the next tick of the negotiation."""
        return self._negotiation.next_wake()

    def _redundant(self, advised: bool) -> bool:
        """Return whether coverage does not need this robot, and there is a frontier for it.

        No robot leaves for a walk along a wall: its neighbours' proofs of coverage need it.
        With a coordinator only `advised` robots leave, and they need not check the criterion that makes it safe.
        """
        situation, local_map = self._situation, self._situation.local_map
        if local_map.slot in (0, NOWHERE) or not (situation.stands and local_map.has_route and situation.clear):
            return False
        if local_map.to_wall:
            return False
        mutual = local_map.mutual()
        others = [local_map.states.get(node) for node in situation.motion.frame.seen if node not in mutual]
        if situation.claims or not all(each is not None and each.waiting for each in others):
            return False
        if self._advice_client is not None and not advised:
            return False
        if self._judged[0] is not local_map.plan_basis:
            judge = is_within if advised else is_redundant
            margin_rad = local_map.parameters.corner_margin_rad
            self._judged = local_map.plan_basis, judge(local_map.scan(), local_map.slot, margin_rad)
        return self._judged[1]

    def _report(self) -> StandingReport | None:
        """Return this robot's part of the complex for a coordinator; None while the robot does not know it."""
        local_map, neighbours = self._situation.local_map, self._negotiation.neighbour_list
        if neighbours is None or not (self._situation.stands or local_map.redundant):
            return None
        if local_map.slot == NOWHERE or local_map.redundant:
            return StandingReport(0, neighbours.version, neighbours.listed, (), not local_map.redundant, False)
        basis = local_map.plan_basis
        if basis is None:
            return None
        if self._fenced[0] is not basis:
            nodes = [local_map.at(slot) for slot in local_map.boundary_slots()]
            self._fenced = basis, tuple(sorted(node for node in nodes if node is not None))
        needed = self._judged[0] is basis and not self._judged[1]
        willing = local_map.slot != 0 and not (self._situation.claims or needed)
        return StandingReport(0, neighbours.version, neighbours.listed, self._fenced[1], True, willing)


def is_redundant(scan: ScanResult, slot: int, corner_margin_rad: float) -> bool:
    """Return whether a slot can be vacated: it is within the covered space, and the link criterion holds."""
    linked = _surrounded(scan, slot) and may_leave(slot, scan.complex_.neighbours)
    return linked and not opens(scan, slot, corner_margin_rad)


def is_within(scan: ScanResult, slot: int, corner_margin_rad: float) -> bool:
    """Return whether a slot is within the covered space, and would be if it were vacated."""
    return _surrounded(scan, slot) and not opens(scan, slot, corner_margin_rad)


def _surrounded(scan: ScanResult, slot: int) -> bool:
    """Return whether a slot has triangles all around."""
    views, complex_, _ = scan
    return bool(complex_.neighbours[slot]) and not any(True for _ in wedges(views, complex_, [slot]))
