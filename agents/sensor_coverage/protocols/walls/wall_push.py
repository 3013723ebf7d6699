"""The leader of a push at a wall: it drives into an open arc, its followers close up, and it follows the wall.

The walk ends where it closes nothing any more. Then the
leader leaves the complex, and the next push may begin with it. Where no standing robot sees it further on, it keeps its
new slot, and the deployment goes on from there.
"""

import math
from abc import abstractmethod
from collections.abc import Collection, Sequence
from typing import Final, Protocol

from zwerm.agents.sensor_coverage.frontier.directions import wrapped
from zwerm.agents.sensor_coverage.frontier.plan import WALLS, Plan
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import LOST, OPEN, SHUT, STRETCH, NearWalls, Sighting, Waypoint
from zwerm.agents.sensor_coverage.messages.pushes import AllStanding, Body, PushAborted
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult
from zwerm.agents.sensor_coverage.motion.triangulation import distances_m
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import IDLE_LEGS_MAX, WalkResult, WallWalk
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap
from zwerm.agents.sensor_coverage.protocols.push_chain import PushChain
from zwerm.agents.sensor_coverage.protocols.walls.wall_protocol import WallProtocol
from zwerm.maths.simplicial import may_leave

# Bound of the legs of one walk.
LEGS_MAX: Final = 15
# Ticks in which the robot behind judges the walk, once it stands, and informs the leader.
NEWS_TICKS: Final = 20


class WallSituation(Protocol):
    """The part of a robot's situation that a push at a wall depends on."""

    @property
    def tick(self) -> int:
        """The number of the current tick."""

    @property
    def wall_walk(self) -> WallWalk:
        """This robot's walk along walls."""

    def stand(self) -> None:
        """End a drive."""

    def to_wall(self, bearing_rad: float, hop_m: float, hand: int, half_rad: float) -> None:
        """Begin to drive to a wall, and along it until the start is clear, and `half_rad` beside the bearing."""

    def probe(self, bearing_rad: float, hop_m: float, hand: int, half_rad: float) -> None:
        """Begin to follow a wall close by, past the direction `half_rad` beside the bearing, and return."""

    def follow_wall(self, hand: int, keep: Collection[int]) -> None:
        """Begin to follow the wall in touch, in sight of a robot of `keep`, or of any robot if `keep` is empty."""


class WallPush:
    """The part of a push that leads to a wall, beside a `PushPart`. `walls` is the robot's protocol of walks."""

    walls: WallProtocol | None = None
    id: int
    phase: str
    _since: int
    _fresh: int
    _back: int | None
    _chain: PushChain
    _plan: Plan | None
    _anchors: tuple[Sighting, ...]
    _behind_settled: bool
    _walks: bool
    _walk_over: bool
    _situation: WallSituation
    _map: LocalMap
    _legs = _idle_legs = 0
    _way: tuple[Waypoint, ...] = ()  # points of the walk
    _has_helped = False  # the walk has closed a part of an arc
    _is_idle = False  # the walk has closed nothing, and ended where the robot behind is out of sight
    _near = NearWalls()  # around this robot's slot, which the leader has followed
    _probes: Sequence[tuple[Plan, int]] = ()  # probes that are left, with the hand at the wall
    _has_probed = False
    _is_spare = False  # the walk has ended in sight of the swarm, which needs no robot there

    @property
    @abstractmethod
    def _heading(self) -> float: ...

    @property
    @abstractmethod
    def _waited(self) -> int: ...

    @abstractmethod
    def _enter(self, phase: str) -> None: ...

    @abstractmethod
    def lead(self) -> None:
        """Be the leader."""

    @abstractmethod
    def cleared(self) -> None:
        """Take in that the follower can take the leader's slot."""

    @abstractmethod
    def close(self, end: Body) -> None:
        """End the push."""

    @abstractmethod
    def _find_anchors(self) -> tuple[Sighting, ...]: ...

    @abstractmethod
    def _correct(self) -> None: ...

    @abstractmethod
    def _settled(self) -> None: ...

    @abstractmethod
    def _write(self, body: Body) -> None: ...

    def lead_from_base(self, direction_rad: float, hand: int) -> None:
        """Be the leader, from the base's point into an open arc of the base."""
        hop_m = self._map.parameters.hop_m
        self._plan = Plan((0, 0, 0, WALLS), 0, direction_rad, hop_m, 0.0, (0,), walk=True, hand=hand)
        self.lead()

    def walk_ended(self) -> None:
        """Take in that the leader's walk has ended: wait no longer than after another push."""
        self._walks, self._since = False, self._situation.tick if self.phase == "await" else self._since
        self._walk_over = self._chain.ahead == self._chain.leader[1]

    def _probes_first(self) -> bool:
        """Choose the plan; return whether it is a walk, and walls close to the slot are followed before: nobody has yet."""
        self._map.update_plans()
        self._plan = self._map.best_plan()
        if self._plan is None or not self._plan.walk:
            return False
        self._probes = [(plan, hand) for plan in self._map.probes() for hand in (1, -1)]
        if not self._probe():
            return False
        self._plan = None
        return True

    def _probe(self) -> bool:
        """Begin the next probe; return whether there is one."""
        if not self._probes:
            return False
        plan, hand = self._probes[0]
        self._enter("probing")
        self._situation.probe(wrapped(plan.direction - self._heading), plan.hop_m, hand, plan.half_rad)
        return True

    def _probed(self, result: DriveResult | WalkResult) -> None:
        """Go on with the next probe; after the last one, lead where an arc is still open."""
        self._has_probed = True
        if isinstance(result, WalkResult):
            self._map.note_near(result.near.turned(self._heading))
        (plan, _), *left = self._probes
        is_open = isinstance(result, WalkResult) and result.end == OPEN
        self._probes = [each for each in left if not (is_open and each[0] is plan)]
        if not self._probe():
            self._situation.stand()
            self.lead()

    def _approach(self, plan: Plan) -> None:
        """Drive into an open arc, to a wall, and past the edge of the arc: the walk begins there, and closes all of it."""
        self._enter("approaching")
        bearing = wrapped(plan.aim - self._heading)
        self._situation.to_wall(bearing, plan.hop_m, -plan.hand, plan.half_rad)

    def _approached(self, result: DriveResult | WalkResult) -> None:
        """Leave the slot to the follower, unless there is no way to get clear of it."""
        near = result.near.turned(self._heading) if isinstance(result, WalkResult) else NearWalls()
        if not isinstance(result, WalkResult) or result.end == SHUT:
            at_base = self._map.slot == NOWHERE
            if not at_base:
                self._map.note_near(near)
            self._situation.stand()
            self.close(
                PushAborted(self.id, True, near.followed, near.past_ends) if at_base else PushAborted(self.id, True)
            )
            return
        self._walks = result.end != OPEN
        self._anchors = () if self._walks else self._find_anchors()
        self._map.occupy(self._fresh)
        self._enter("out")
        self._behind_settled = self._chain.is_rear
        self.cleared()
        self._write(AllStanding(self.id, near.followed, near.past_ends))

    def _go_on(self) -> None:
        """Correct the scale, or follow the wall."""
        if self._walks:
            self._walk()
        else:
            self._correct()

    def _walk(self) -> None:
        """Follow the wall for one leg."""
        plan, protocol = self._plan, self.walls
        if plan is None or protocol is None:
            self._settled()
            return
        self._enter("walking")
        self._legs += 1
        protocol.begin(self.id, plan.hand)
        self._situation.follow_wall(plan.hand, (self._back,) if plan.beside and self._back is not None else ())

    def _walked(self, result: DriveResult | WalkResult) -> None:
        """Follow the wall further while that closes something; else stand at the new slot where the walk has ended."""
        plan, protocol = self._plan, self.walls
        if isinstance(result, WalkResult):
            self._way += result.waypoints
        closed = protocol is not None and protocol.has_closed()
        self._idle_legs = 0 if closed else self._idle_legs + 1
        self._has_helped = self._has_helped or closed
        on = isinstance(result, WalkResult) and result.end == STRETCH
        if on and self._legs < LEGS_MAX and self._idle_legs < IDLE_LEGS_MAX:
            self._walk()
            return
        if protocol is not None:
            protocol.end(self.id)
        self._is_spare = isinstance(result, WalkResult) and result.end != LOST
        self._is_idle = plan is not None and plan.beside and not self._is_spare and not self._has_helped
        self._map.note_distances(distances_m(self._way))
        if plan is not None:
            self._map.distances_m[plan.mover] = math.hypot(*self._situation.wall_walk.way)
        self._settled()

    def _is_judged(self) -> bool:
        """Return whether the robot behind has had time to find that its arc is closed while the leader stands here."""
        return not self._is_idle or self._waited > NEWS_TICKS

    def _leave_if_spare(self) -> None:
        """Leave the complex after a walk, unless that would part the robots around."""
        slot = self._map.slot
        idle = self._is_idle and self._plan is not None and self._map.path_vectors.is_claimed(self._plan.mover)
        if (self._is_spare or idle) and may_leave(slot, self._map.scan().complex_.neighbours):
            self._map.leave_complex()
