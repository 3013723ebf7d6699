"""Surveillance of the neighbourhood: a standing robot keeps its local map, its plans and its route up to date."""

from typing import ClassVar, Final

from zwerm.agents.sensor_coverage.messages.beacons import PathVector, StateBeacon
from zwerm.agents.sensor_coverage.messages.incarnations import adopted_slot, first_count
from zwerm.agents.sensor_coverage.neighbourhood.beaconing import Beaconing
from zwerm.agents.sensor_coverage.neighbourhood.situation import Situation
from zwerm.agents.sensor_coverage.protocols.component import Component

# Ticks for which a robot may be unsure whether it is at the frontier before it announces doubt. Most pushes end
# earlier.
DOUBT_TICKS: Final = 100


class Surveillance(Component):
    """Averages bearings, makes plans, chooses the route, and has the failure detector ask for missing states."""

    accepts: ClassVar[tuple[type, ...]] = (StateBeacon, PathVector)

    def __init__(self, situation: Situation, beaconing: Beaconing) -> None:
        self._situation = situation
        self._beaconing = beaconing
        self._basis: object = None
        self._route_basis = 0
        self._doubt_at: int | None = None
        self._heard = False  # a neighbour has announced another route, or other hops
        self._polled_at = 0
        self._reach_changed_at = -1

    def receive(self, sender: int, message: StateBeacon | PathVector, tick: int) -> bool:
        """Take in a neighbour's state or route; return whether it changes more than the routes, which `is_idle` compares."""
        situation, local_map = self._situation, self._situation.local_map
        if isinstance(message, PathVector):
            self._heard |= local_map.path_vectors.receive(sender, message)
            return False
        self._heard |= local_map.path_vectors.receive(sender, message.path_vector)
        version = local_map.version
        if situation.failure_detector.answered(sender):
            local_map.unblock(sender)
            local_map.change()
        if local_map.missed(sender, message):
            self._beaconing.missed(tick)
        if local_map.receive(sender, message, tick):
            situation.motion.frame.forget((sender,))
        return local_map.version != version

    def restarted(self, node: int, tick: int) -> None:
        """Forget a robot that has lost its memory, and average its bearing again."""
        self._situation.local_map.restarted(node)
        self._situation.motion.frame.forget((node,))

    def poll(self, tick: int) -> None:
        """Update the local map if anything has changed; do nothing during a drive."""
        situation, local_map = self._situation, self._situation.local_map
        if local_map.slot == 0:
            local_map.reach.be_base(tick, first_count(situation.incarnation))
        if local_map.moving:
            return
        self._polled_at, self._heard = tick, False
        self._update_reach(tick)
        if not situation.active:
            if situation.displaced:
                situation.recover()
            elif situation.unsure:
                situation.look_around()
            elif situation.alone or situation.is_cut_off():
                situation.come_back()
                return
        basis = self._present_basis()
        if basis != self._basis or tick >= self._next_timer():
            self._basis = basis
            self._update(tick)
        elif local_map.path_vectors.version == self._route_basis:
            return  # nothing is new
        self._route_basis = local_map.path_vectors.version
        if situation.calm:
            local_map.find_route(tick)
        elif self._doubt_at is not None and tick >= self._doubt_at:
            local_map.claim_doubt(tick)

    def next_wake(self) -> int | None:
        """Return the tick at which a handover or the time without doubt ends."""
        handover, doubt_at = self._situation.local_map.handovers_until, self._doubt_at
        if doubt_at is None or doubt_at <= self._situation.tick:
            return handover
        return doubt_at if handover is None else min(handover, doubt_at)

    def is_idle(self, tick: int) -> bool:
        """Return whether the robot stands, sees and knows what it did when it was polled last, and has the same route."""
        situation, local_map = self._situation, self._situation.local_map
        if self._present_basis() != self._basis or tick >= self._next_timer() or local_map.moving:
            return False
        if self._heard and not self._keeps_route(tick):
            return False
        reaches = self._reach_changed_at != self._polled_at and not local_map.reach.is_lost(tick)
        return reaches and bool(situation.bearings) and not situation.displaced

    def _keeps_route(self, tick: int) -> bool:
        """Choose the route again; return whether it is the same, and the way to the base is."""
        local_map, self._heard = self._situation.local_map, False
        route = local_map.route
        if local_map.path_vectors.version != self._route_basis:
            self._route_basis = local_map.path_vectors.version
            if self._situation.calm:
                local_map.find_route(tick)
        return not self._update_reach(tick) and local_map.route == route

    def _update_reach(self, tick: int) -> bool:
        """Take in the neighbours' hops to the base; return whether that changed anything."""
        changed = self._situation.local_map.reach.update(tick, self._situation.homes.values())
        if changed:
            self._reach_changed_at = tick
        return changed

    def _present_basis(self) -> object:
        """Return what plans depend on."""
        situation = self._situation
        return situation.local_map.version, tuple(situation.motion.frame.seen), not situation.active

    def _find_slot(self) -> None:
        """After a restart away from the base, take the place where the robot stands as a new slot."""
        situation, local_map = self._situation, self._situation.local_map
        if situation.homeless and local_map.at_base is False and local_map.heading is not None:
            local_map.occupy(adopted_slot(situation.node, situation.incarnation))

    def _next_timer(self) -> int:
        situation = self._situation
        earliest = self._beaconing.heartbeat
        for each in (situation.failure_detector.due, situation.local_map.handovers_until, self._doubt_at):
            if each is not None and each < earliest:
                earliest = each
        return earliest

    def _update(self, tick: int) -> None:
        """Update headings, references and plans, and ask for missing states.

        While slots around change hands, the frontier and the route stay as they were, because slots outlive occupants.
        """
        situation, local_map = self._situation, self._situation.local_map
        local_map.resolve_duplicate()
        local_map.find_whether_at_base(situation.bearings)
        local_map.find_heading()
        self._find_slot()
        local_map.learn_references()
        situation.calm = situation.clear
        self._doubt_at = None if situation.calm else self._doubt_at or tick + DOUBT_TICKS
        if situation.calm:
            local_map.update_plans()
        motion = situation.motion
        situation.failure_detector.check(tick, local_map, motion.frame.seen, motion.samples)
