"""One robot's knowledge of a push, and its conditions to continue: which robots stand, and how long it waits.

A robot of the chain that is out of range, has lost its memory, or is dead does not stop the others: each waiting time
has a bound.
"""

import math
from collections.abc import Callable, Collection, Mapping
from typing import Final, Protocol

from zwerm.agents.sensor_coverage.frontier.directions import angle_between, wrapped
from zwerm.agents.sensor_coverage.frontier.plan import Plan
from zwerm.agents.sensor_coverage.messages.commands import Sighting
from zwerm.agents.sensor_coverage.messages.pushes import Body, Chain, LeaderReady, SlotMemory, TakeSlot
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult
from zwerm.agents.sensor_coverage.motion.push_geometry import FIRST_BEARINGS_RAD, direction_to
from zwerm.agents.sensor_coverage.neighbourhood.neighbour_table import NeighbourTable
from zwerm.agents.sensor_coverage.protocols.push_chain import PushChain

# Bounds of the ticks to wait. LINK, WAVE: for the token, and for another robot's drive. VACATED, ARMED, HOLD: for the
# leader to leave or to give up, and for its neighbours to agree. LOST: for a robot out of range. CLOSE: for this
# robot's neighbours to agree at the end. TELL: for a robot behind that is out of range at the end. WALK: for a leader
# that follows a wall.
LINK_TICKS: Final = 1000
WAVE_TICKS: Final = 600
VACATED_TICKS: Final = 80
ARMED_TICKS: Final = 300
HOLD_TICKS: Final = 600
LOST_TICKS: Final = 100
CLOSE_TICKS: Final = 80
TELL_TICKS: Final = 4
WALK_TICKS: Final = 1200
# After VACATED_TICKS a follower checks this often [ticks] whether the leader's slot is vacant.
VACANCY_PERIOD_TICKS: Final = 20
# With noisy bearings a robot homes again after so many moves by odometry, or if its place in the chain is even: that takes 5 s,
# and odometry is off by a small fraction of a hop. Where all moves begin at the base, it is even every second time.
HOMED_EVERY: Final = 2
# A leader that is visible within this angle [rad] of its slot's direction is still there, or back.
BACK_RAD: Final = 0.3


class PushSituation(Protocol):
    """The part of a robot's situation that its part in a push depends on."""

    @property
    def node(self) -> int:
        """The robot's id."""

    @property
    def tick(self) -> int:
        """The number of the current tick."""

    @property
    def bearings(self) -> Mapping[int, float]:
        """Bearings [rad] of the visible robots that are not declared dead."""

    @property
    def dead(self) -> Collection[int]:
        """The robots that this robot has found to be dead."""

    @property
    def clear(self) -> bool:
        """True if the robot stands still, has averaged bearings, and no slot around it changes hands."""

    @property
    def local_map(self) -> NeighbourTable:
        """The robot's neighbours."""


class PushPart:
    """The state of one robot's part in one push. `over` once it has ended; `end` is its last message, as far as known.

    `chain` are the robots of the push, rear to front, each with its slot before the push. `back` is the robot or base
    that sent the token, and `next` the robot that it went to. `first`: no robot has left the base yet.
    """

    def __init__(
        self,
        situation: PushSituation,
        announce_vacated: Callable[[int], None],
        push: int,
        fresh: int,
        chain: Chain,
        back: int | None,
        first: bool = False,
    ) -> None:
        self.id = push
        self.phase = "link"
        self.over = False
        self.relays = False  # whether the end of the push can go to the base by way of other robots
        self.end: Body | None = None
        self.is_untold = False  # the base is out of sight, and needs the end
        self.next: int | None = None
        self._situation: PushSituation = situation
        self._map: NeighbourTable = situation.local_map
        self._announce_vacated = announce_vacated
        self._since = situation.tick
        self._fresh = fresh
        self._chain = PushChain(chain, situation.node)
        self._back = back if self._chain.is_rear else self._chain.behind
        self._memory: SlotMemory | None = None
        self._ahead_rad: float | None = None  # the bearing of the robot ahead at its slot
        self._start: tuple[float, float] | None = None  # of the move to the slot ahead, by odometry
        self._plan: Plan | None = None
        self._led_at = situation.tick
        self._behind_rad: float | None = None  # the bearing of the follower at this robot's slot
        self._bounded = False  # whether the leader knows when it is back
        self._first_bearings = list(FIRST_BEARINGS_RAD) if first else []
        self._vacated = False
        self._ahead_stands = self._behind_settled = False
        self._result = DriveResult(True)
        self._anchors: tuple[Sighting, ...] = ()
        self._leader_epoch = -1
        self._back_ticks = 0  # bound of the ticks for which a leader that a wall stops is out of sight, 0 if not known
        self._leader_seen_at = 0
        self._walks = self._walk_over = False  # whether the leader follows a wall, and has ended
        self._lost: dict[int, None] = {}  # robots that have restarted since this robot takes part

    # --- conditions ---------------------------------------------------------------------------------------------------

    @property
    def _waited(self) -> int:
        """Ticks since the present phase began."""
        return self._situation.tick - self._since

    @property
    def _heading(self) -> float:
        return self._map.heading or 0.0

    def _wait_ticks(self, node: int | None) -> int:
        """Return the ticks to wait for a robot of the chain: few if it is not visible and so out of range."""
        if node in self._lost:
            return 0
        return WAVE_TICKS if node is not None and node in self._situation.bearings else LOST_TICKS

    def _leader_is_back(self) -> bool:
        """Return whether the leader stands at its slot after a later drive than it announced, or lost its memory."""
        slot, leader = self._chain.leader
        if leader in self._lost:
            return True
        state = self._map.states.get(leader)
        return state is not None and not state.moving and state.slot == slot and state.epoch > self._leader_epoch

    def _leader_is_gone(self) -> bool:
        """Return whether the leader is not visible, or visible beside its slot: its announcement was lost."""
        memory, (_, leader) = self._memory, self._chain.leader
        if memory is None or leader not in self._situation.bearings:
            return True
        back_rad = direction_to(memory, self._chain.origin)
        seen_rad = self._situation.bearings[leader] + self._heading
        return back_rad is not None and angle_between(back_rad + math.pi, seen_rad) > BACK_RAD

    def _leader_stays_away(self) -> bool:
        """Return whether the leader has been out of sight for so long that no wall has stopped it."""
        if self._chain.leader[1] in self._situation.bearings:
            self._leader_seen_at = self._situation.tick
        return 0 < self._back_ticks < self._situation.tick - self._leader_seen_at

    def _has_lost_behind(self) -> bool:
        """Return whether this robot does not see the robot behind, which is not known to be dead or without memory."""
        gone = self._back in self._situation.dead or self._back in self._lost
        return not gone and self._back not in self._situation.bearings

    def _is_apart(self) -> bool:
        """Return whether this robot does not see the robot behind, nor any robot that sees it."""
        states = self._map.states
        between = (states[node].seen for node in self._situation.bearings if node in states)
        return self._has_lost_behind() and not any(each.node == self._back for seen in between for each in seen)

    def _back_bearing_rad(self) -> float:
        """Return the approximate bearing of the robot that has taken this robot's former slot."""
        there_rad = direction_to(self._memory, self._chain.origin)
        return 0.0 if there_rad is None else wrapped(there_rad - self._heading)

    def _note_move(self, result: DriveResult) -> None:
        """Record the end of the move to the slot ahead."""
        self._result = result
        self._map.odometry_moves = self._map.odometry_moves + 1 if result.used_moving_landmarks else 0

    def _homes_again(self, noisy: bool) -> bool:
        """Return whether to home again, now that all landmarks stand; `noisy`: it takes long."""
        due = not noisy or self._chain.is_even or self._map.odometry_moves >= HOMED_EVERY
        return self._result.used_moving_landmarks and due

    def _stays(self) -> bool:
        """Return whether this robot does not drive any more, if it sees its neighbours in the chain."""
        return self._is_straight and not self._homes_again(noisy=True)

    def _homes_early(self, noisy: bool) -> bool:
        """Return whether to home again before all robots behind have: the one behind stands at this robot's former slot.

        So every second robot of a chain homes at the same time, and those between them stand.
        """
        if not noisy or not self._chain.is_even or self._chain.is_rear or self._back is None or self._memory is None:
            return False
        behind = self._map.states.get(self._back)
        stands = behind is not None and not behind.moving and behind.slot == self._chain.origin
        return stands and self._is_straight and self._homes_again(noisy)

    @property
    def _is_straight(self) -> bool:
        """True if the distance to the robot behind needs no correction: bearings determined it, and no walk measured it."""
        return not self._result.used_odometry and not self._is_measured

    @property
    def _is_measured(self) -> bool:
        """True if a walk has measured the distance to this robot's former slot."""
        return self._chain.origin in self._map.distances_m

    def _vacancy_check_due(self) -> bool:
        return self._waited > VACATED_TICKS and self._waited % VACANCY_PERIOD_TICKS == 1

    def _take_memory(self, body: LeaderReady | TakeSlot) -> None:
        """Take in the memory of the slot ahead, and the bearing of the robot that still stands there."""
        self._chain, self._memory = PushChain(body.chain, self._chain.me), body.memory
        self._walks = body.walk
        ahead = self._chain.ahead
        self._ahead_rad = None if ahead is None else self._situation.bearings.get(ahead)

    # --- phases ------------------------------------------------------------------------------------------------------

    def _enter(self, phase: str) -> None:
        self.phase, self._since = phase, self._situation.tick

    def _wake_after(self, ticks: int) -> int:
        """Return the tick after `ticks` of this phase, or the next tick if that has passed."""
        return max(self._situation.tick + 1, self._since + ticks + 1)

    def _next_vacancy_check(self) -> int:
        if self._back_ticks:
            return self._next_tick()
        checks = self._waited // VACANCY_PERIOD_TICKS + 1
        return self._since + max(VACATED_TICKS + 1, checks * VACANCY_PERIOD_TICKS + 1)

    def _next_tick(self) -> int:
        return self._situation.tick + 1

    def _wake_for_ahead(self) -> int:
        return self._wake_after(self._wait_for_ahead_ticks())

    def _wake_for_behind(self) -> int:
        return self._wake_after(self._wait_ticks(self._chain.behind))

    def _waited_for_ahead(self) -> bool:
        return self._waited > self._wait_for_ahead_ticks()

    def _wait_for_ahead_ticks(self) -> int:
        return WALK_TICKS if self._walks and self.phase == "await" else self._wait_ticks(self._chain.ahead)

    def _settled_behind(self) -> bool:
        return self._behind_settled or self._waited > self._wait_ticks(self._chain.behind)

    def _token_is_lost(self) -> bool:
        """Return whether the robot that the token went to is dead or out of range, or takes too long."""
        gone = self.next is not None and (self.next in self._lost or self.next not in self._situation.bearings)
        return (gone and self._waited > LOST_TICKS) or self._waited > LINK_TICKS

    def _may_offer(self) -> bool:
        return self._situation.clear or self._waited > HOLD_TICKS

    def _may_finish(self) -> bool:
        # Neighbours are informed of the end of the leader's drive one tick later.
        informed = self._waited > 1 or not self._chain.leads or self.next is not None
        return (self._situation.clear and informed) or self._waited > CLOSE_TICKS

    def _out_of_range(self) -> bool:
        tells = self.relays or not self._chain.is_rear
        return tells and self._waited > TELL_TICKS and self._back not in self._situation.bearings
