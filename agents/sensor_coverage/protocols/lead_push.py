"""The leader of a push: it offers its slot to its follower, and drives into unknown space.

A leader that a wall stopped is back at its slot, and tries the next direction from there at once: no other robot has moved.
If it does not see its follower then, it drives towards it until it does, so that the follower does not come.
"""

import math
from abc import abstractmethod
from collections.abc import Collection, Iterable, Mapping
from typing import Final, Protocol

from zwerm.agents.sensor_coverage.frontier.directions import wrapped
from zwerm.agents.sensor_coverage.frontier.plan import Plan
from zwerm.agents.sensor_coverage.messages.commands import Sighting
from zwerm.agents.sensor_coverage.messages.pushes import AllStanding, Body, LeaderReady, PushAborted
from zwerm.agents.sensor_coverage.motion.locomotion import Locomotion
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult, back_ticks
from zwerm.agents.sensor_coverage.motion.push_geometry import FIRST_BEARINGS_RAD
from zwerm.agents.sensor_coverage.motion.triangulation import distances_m
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import CLEAR_M, WalkResult
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap
from zwerm.agents.sensor_coverage.protocols.push_chain import PushChain
from zwerm.agents.sensor_coverage.protocols.transport.mailbox import ReliableMailbox

# A leader begins no other try after this many ticks: the robots behind wait for it.
TRIES_TICKS: Final = 400


class LeadSituation(Protocol):
    """The part of a robot's situation that the leader of a push depends on."""

    motion: Locomotion
    mailbox: ReliableMailbox

    @property
    def bearings(self) -> Mapping[int, float]:
        """Bearings [rad] of the visible robots that are not declared dead."""

    @property
    def dead(self) -> Collection[int]:
        """The robots that this robot has found to be dead."""

    def clear_m(self, bearing_rad: float, wanted_m: float) -> float:
        """Return how far [m] a leader has to get."""

    def body_in_the_way(self, result: DriveResult, bearing_rad: float) -> int | None:
        """Return the robot that stopped a drive and may hide free space, or None."""

    def leave_station(self, station: int, bearings_rad: Iterable[float]) -> None:
        """Begin to follow the walls that are met along these bearings, as far as the station is in sight."""

    def regain(self, node: int, bearing_rad: float | None = None) -> None:
        """Begin to look for a robot that was in sight along a bearing [rad]."""

    def stand(self) -> None:
        """End a drive."""


class LeadPush:
    """The part of a push in which this robot leads, beside a `PushPart`."""

    id: int
    _since: int
    _led_at: int
    _fresh: int
    _back: int | None
    _behind_rad: float | None
    _bounded: bool
    _chain: PushChain
    _plan: Plan | None
    _anchors: tuple[Sighting, ...]
    _first_bearings: list[float]
    _situation: LeadSituation
    _map: LocalMap

    @property
    @abstractmethod
    def _heading(self) -> float: ...

    @abstractmethod
    def _enter(self, phase: str) -> None: ...

    @abstractmethod
    def _has_lost_behind(self) -> bool: ...

    @abstractmethod
    def close(self, end: Body) -> None:
        """End the push."""

    @abstractmethod
    def _deploy(self) -> None: ...

    @abstractmethod
    def _correct(self) -> None: ...

    @abstractmethod
    def _settled(self) -> None: ...

    @abstractmethod
    def _write(self, body: Body) -> None: ...

    def _write_ready(self, behind: int, plan: Plan) -> None:
        """Offer this slot to the follower."""
        self._behind_rad = self._situation.bearings.get(behind, self._behind_rad)
        self._bounded = not plan.walk and not any(
            each in self._situation.motion.frame.seen for each in self._situation.dead
        )
        back = back_ticks(self._situation.motion, plan.clear_m) if self._bounded else 0
        ready = LeaderReady(self.id, self._chain.links, self._map.memory(), self._map.epoch, plan.walk, back)
        self._situation.mailbox.write(behind, ready)

    def _clear_m(self, plan: Plan) -> float:
        """Return how far [m] this robot has to get."""
        return self._situation.clear_m(wrapped(plan.direction - self._heading), plan.clear_m)

    def _deployed(self, result: DriveResult) -> None:
        if not result.ok:
            self._blocked(result)
            return
        self._anchors = self._find_anchors()
        self._map.occupy(self._fresh)
        if self._first_bearings:
            self._map.heading = 0.0
            self._correct()
            return
        self._enter("out")
        self._write(AllStanding(self.id))

    def _blocked(self, result: DriveResult) -> None:
        """End the push after a test drive that met a wall; the first robot tries its other bearings before."""
        if self._plan is not None:
            body = self._situation.body_in_the_way(result, wrapped(self._plan.direction - self._heading))
            if body is None:
                if self._tries(self._map.note_failure(self._plan, result.driven_m)):
                    return
            else:
                self._map.note_obstruction(self._plan, result.driven_m, body)
        elif len(self._first_bearings) > 1:
            del self._first_bearings[0]
            self._deploy()
            return
        elif self._first_bearings and self._map.parameters.walls == "followed" and self._back is not None:
            self._enter("leaving")
            self._situation.leave_station(self._back, FIRST_BEARINGS_RAD)
            return
        self._rejoin()

    def _rejoin(self) -> None:
        """Drive into sight of the follower, if it does not see that this robot is back; then end the push."""
        if self._back is not None and self._behind_rad is not None and self._has_lost_behind():
            self._enter("rejoining")
            self._situation.regain(self._back, self._behind_rad)
        else:
            self._give_up()

    def _give_up(self) -> None:
        """Stand at the slot, and end the push."""
        self._situation.stand()
        self.close(PushAborted(self.id, True))

    def _tries(self, plan: Plan | None) -> bool:
        """Try another direction from this slot at once: no robot has moved but this one, which is back."""
        if plan is None or self._has_lost_behind() or self._since - self._led_at > TRIES_TICKS:
            return False
        self._plan = plan
        if self._chain.behind is None:
            self._deploy()
        else:
            self._enter("offering")
            self._write_ready(self._chain.behind, plan)
        return True

    def _left_station(self, result: WalkResult) -> None:
        """Stand at the new slot where the first robot got away from the base along a wall, or end the push."""
        if result.driven_m > CLEAR_M:
            self._map.occupy(self._fresh)
            self._map.heading = 0.0
            self._map.note_distances(distances_m(result.waypoints))
            self._settled()
        else:
            self._give_up()

    def _find_anchors(self) -> tuple[Sighting, ...]:
        """Return the robots that determine the leader's distance, with their approximate bearings."""
        if self._first_bearings:
            return (Sighting(self._back or 0, wrapped(self._first_bearings[0] + math.pi)),)
        if self._plan is None:
            return ()
        back_rad = wrapped(self._plan.aim + math.pi - self._heading)
        future = self._chain.future()
        nodes = [future.get(slot, self._map.at(slot)) for slot in self._plan.anchors]
        return tuple(Sighting(node, back_rad) for node in nodes if node is not None)
