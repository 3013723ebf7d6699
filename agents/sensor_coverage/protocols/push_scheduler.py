"""The base station's schedule of pushes: it starts them one by one, and decides when the deployment ends.

The base starts a push when its route leads to a frontier. The push begins at a robot that waits at the base, or at a
redundant robot that has offered itself. Without a route for some time the base takes the census, and concludes from it.
"""

from typing import Any, ClassVar, Final

from zwerm.agents.sensor_coverage.frontier.plan import Plan
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE, StateBeacon
from zwerm.agents.sensor_coverage.messages.commands import NearWalls
from zwerm.agents.sensor_coverage.messages.incarnations import first_count
from zwerm.agents.sensor_coverage.messages.pushes import (
    AllStanding,
    PushAborted,
    PushDone,
    PushToken,
    RedundantCall,
    RedundantOffer,
    RedundantPushEnd,
)
from zwerm.agents.sensor_coverage.messages.walls import WalkOver
from zwerm.agents.sensor_coverage.neighbourhood.beaconing import Beaconing
from zwerm.agents.sensor_coverage.neighbourhood.situation import Situation
from zwerm.agents.sensor_coverage.protocols.component import Component
from zwerm.agents.sensor_coverage.protocols.ending.completion_census import CompletionProtocol
from zwerm.agents.sensor_coverage.protocols.ending.release_roster import ReleaseRoster
from zwerm.agents.sensor_coverage.protocols.ending.termination import Termination
from zwerm.agents.sensor_coverage.protocols.push_part import CLOSE_TICKS

# Bounds of the ticks to wait: for a robot to come out, and for a push to end.
RELEASE_TICKS_MAX: Final = 60
PUSH_TICKS_MAX: Final = 2000
# The same after the end of a walk: the walking robot may be out of range of those that would report the end of its push.
WALKED_TICKS_MAX: Final = 3 * CLOSE_TICKS
# Ticks after a push to wait for news of an edge before gaps are expanded.
GAP_TICKS: Final = 24
# Bound of the ticks to wait for a robot that stands at the base and is not ready.
READY_TICKS_MAX: Final = 1500
# Where no robot can leave the base, although others have left it: attempts before the base gives up, and ticks between them.
# Meanwhile the robot finds out which bodies in its way are dead and can be pushed, and robots that are cut off may come back.
LEAVES_MAX: Final = 8
LEAVE_TICKS: Final = 400
# Number of pushes before a pause, and ticks of the pause: redundant robots negotiate while all robots stand still.
PAUSE_EVERY: Final = 10
PAUSE_TICKS: Final = 80


class PushScheduler(Component):
    """The base station's part in pushes.

    `cycles` counts deployment attempts, `pushes` successful ones, and `released` the robots that came out of the depot.
    `outcome` says how the deployment ended, and is empty before. `release`: let a robot out in this tick. `idle`: no
    push is active.
    """

    accepts: ClassVar[tuple[type, ...]] = (
        StateBeacon,
        PushToken,
        PushAborted,
        AllStanding,
        PushDone,
        RedundantOffer,
        RedundantPushEnd,
        WalkOver,
    )

    def __init__(self, situation: Situation, beaconing: Beaconing, completion: CompletionProtocol) -> None:
        self.cycles = 0
        self.pushes = 0
        self.outcome = ""
        self.release = False
        self._situation = situation
        self._map = situation.local_map
        self._beaconing = beaconing
        self._termination = Termination(completion)
        self._roster = ReleaseRoster(situation.incarnation == 1)
        self._released_at: int | None = None
        self._released_before = -1  # robots that had come out when the latest one was released
        self._active: int | None = None  # the push that is active
        self._is_first = False
        self._to_gap = False
        self._rear: int | None = None  # the robot that the active push takes from the base
        self._since = self._edges_since = 0
        self._walked_at: int | None = None  # when the walk of the active push ended
        self._not_ready_since = 0
        self._blocked = 0  # attempts in a row in which no robot could leave the base
        self._leave_at = 0  # tick of the next attempt
        self._tokens = first_count(situation.incarnation)  # the number of a push is the name of a slot
        self._paused_at = 0
        self._paused_until: int | None = None
        self._offers: dict[int, tuple[int, ...]] = {}  # slot of a redundant robot: the slots from there to the base

    @property
    def idle(self) -> bool:
        """True if no push is active."""
        return self._active is None

    @property
    def released(self) -> int:
        """Number of robots that have come out of the depot."""
        return len(self._roster.known)

    @property
    def takes_census(self) -> bool:
        """True if the base may begin waves of the census."""
        return self._termination.takes_census and not self.outcome

    def see(self, visible: list[int]) -> None:
        """Take in the visible robots: a robot that comes out of the depot is one of them."""
        self._roster.see(visible)
        self._termination.let_out(self._roster.known)

    def receive(self, sender: int, message: Any, tick: int) -> None:
        """Take in a new neighbour's state, or a message of a push."""
        match message:
            case StateBeacon(slot=slot):
                self._roster.receive(sender, message)
                if sender not in self._map.states and slot == NOWHERE:
                    self._beaconing.repeat(tick)  # the new robot needs the base's view for its heading
            case PushToken(push):
                self._situation.mailbox.write(sender, PushAborted(push, False))
            case RedundantOffer(_, slots):
                self._offers[slots[0]] = slots
            case PushAborted(push, tried, near, past_ends) if push == self._active:
                if near:
                    self._map.note_near(NearWalls(near, past_ends))
                self._end(tried)
            case AllStanding(push, near, past_ends) if push == self._active and near:
                self._map.note_near(NearWalls(near, past_ends))
            case PushDone(push) if push == self._active:
                self._end(True, True)
            case RedundantPushEnd(push, tried, done) if push == self._active:
                self._end(tried, done)
            case WalkOver(push) if push == self._active and self._walked_at is None:
                self._walked_at = tick
            case _:
                pass

    def restarted(self, node: int, tick: int) -> None:
        """End the active push if the robot that it took from the base has lost its memory."""
        if self._active is not None and node == self._rear:
            self._end(False)

    def is_idle(self, tick: int) -> bool:
        """Return False: pushes and the end have times of their own."""
        return False

    def poll(self, tick: int) -> None:
        """Give up a push if its first message was lost, and start the next push if it is time."""
        mailbox = self._situation.mailbox
        for to, body in mailbox.lost:
            self._map.forget(to)
            if isinstance(body, PushToken | RedundantCall) and body.push == self._active:
                self._end(False)
        mailbox.sent.clear()
        mailbox.lost.clear()
        if self._map.guests != self._roster.guests:
            self._map.guests = self._roster.guests
            self._map.change()
        if not self.outcome:
            if self._active is not None:
                self._watch_push(tick, self._active)
            else:
                self._start_push(tick)
        if not self.outcome:
            self.outcome = self._termination.stalled(tick)
            if self.outcome:
                self._report_numbers()

    def next_wake(self) -> int | None:
        """Return the tick at which the push of a walk that is over ends, if a push is active."""
        if self._active is None or self._walked_at is None:
            return None
        return self._walked_at + WALKED_TICKS_MAX + 1

    # --- one push -----------------------------------------------------------------------------------------------------

    def _watch_push(self, tick: int, push: int) -> None:
        """End a push that takes too long, and release the next robot in time."""
        self._not_ready_since = tick
        if tick - self._since > PUSH_TICKS_MAX or self._rear in self._situation.failure_detector.dead:
            self._end(False)
        elif self._walked_at is not None and tick - self._walked_at > WALKED_TICKS_MAX:
            self._end(True, True)
        elif self._released_at is None and self._rear_has_left() and not self._offers:
            self._let_out(tick)

    def _start_push(self, tick: int) -> None:
        """Start the next push, or wait for its conditions."""
        visible = self._situation.bearings
        # A robot that has left the complex makes no plans: with such neighbours only, nobody looks for the frontier.
        alone = not any(
            node in visible and each.slot not in (0, NOWHERE) and not each.redundant
            for node, each in self._map.states.items()
        )
        wall = None
        if not alone and not self._map.has_route:
            wall = self._own_wall_plan(tick)
            if wall is None:
                self._watch_quiet(tick)
                return
        if not alone and wall is None and self._map.to_gap and tick - self._edges_since < GAP_TICKS:
            return  # news of an edge may be on its way
        self._termination.disturb()
        if self._pauses(tick) or (alone and tick < self._leave_at):
            return
        if not alone and wall is None and self._offers:
            self._call(tick)
            return
        waiting = [node for node, state in sorted(self._map.states.items()) if state.waiting and node in visible]
        if not waiting:
            if not self._not_ready(tick):
                self._let_out(tick)
            return
        via = NOWHERE if alone or wall is not None else self._map.next_hop()
        if via is None:
            return
        self._released_at = None
        push = self._begin(tick, first=alone, rear=waiting[0])
        token = PushToken(push, push, (), via)
        if wall is not None:
            self._map.note_attempt(wall)
            token = PushToken(push, push, (), via, wall.aim, wall.hand)
        self._situation.mailbox.write(waiting[0], token)

    def _own_wall_plan(self, tick: int) -> Plan | None:
        """Return the plan into an open arc of the base itself, if no path leads to a frontier."""
        quiet = self._situation.clear and self._map.route is None and tick - self._edges_since >= GAP_TICKS
        return min(self._map.wall_plans, key=lambda each: each.key) if quiet and self._map.wall_plans else None

    def _call(self, tick: int) -> None:
        """Start the next push at a redundant robot."""
        slots = self._offers.pop(next(iter(self._offers)))
        node = self._map.at(slots[-1])
        if node is not None and node in self._situation.motion.frame.seen:
            push = self._begin(tick, first=False, rear=None)
            self._situation.mailbox.write(node, RedundantCall(push, slots))

    def _begin(self, tick: int, first: bool, rear: int | None) -> int:
        """Record that a push begins, and return its number."""
        self._tokens += 1
        self._to_gap = self._map.to_gap
        self._active, self._since, self._is_first, self._rear = self._tokens, tick, first, rear
        self._walked_at = None
        return self._tokens

    def _end(self, tried: bool, done: bool = False) -> None:
        """Record that the active push has ended."""
        self._active = None
        if tried or done:
            self._termination.progress(self._situation.tick)
        if done or not self._to_gap:  # a failed push into a gap leaves the edges as they were
            self._edges_since = self._situation.tick
        self.cycles += tried or done
        self.pushes += done
        self._report_numbers()
        if done:
            self._blocked = 0
        elif self._is_first and tried:
            self._count_blocked()

    def _count_blocked(self) -> None:
        """Record that no robot could leave the base; give up at once if no other one has been out."""
        self._blocked += 1
        self._leave_at = self._situation.tick + LEAVE_TICKS
        if self.released < 2 or self._blocked >= LEAVES_MAX:
            self.outcome = "source-blocked: no robot can leave the base"

    # --- conditions ---------------------------------------------------------------------------------------------------

    def _pauses(self, tick: int) -> bool:
        """Return whether redundant robots have time to negotiate now."""
        paused = self.pushes // PAUSE_EVERY == self._paused_at // PAUSE_EVERY
        if self._situation.negotiation is None or paused:
            return False
        if self._paused_until is None:
            self._paused_until = tick + PAUSE_TICKS
        if tick < self._paused_until:
            return True
        self._paused_at, self._paused_until = self.pushes, None
        return False

    def _not_ready(self, tick: int) -> bool:
        """Return whether a visible robot has no slot yet, and may be ready soon."""
        homeless = self._homeless()
        if not homeless or self._released_at is not None:
            self._not_ready_since = tick
        return tick - self._not_ready_since < READY_TICKS_MAX and homeless and self._released_at is None

    def _homeless(self) -> bool:
        """Return whether a visible robot that is not dead has no slot."""
        states = self._map.states
        return any(node not in states or states[node].slot == NOWHERE for node in self._situation.bearings)

    def _rear_has_left(self) -> bool:
        """Return whether the robot that the push took from the base has its slot: the next robot has time to average."""
        states = self._map.states
        rear = None if self._rear is None else states.get(self._rear)
        no_robot_waits = not any(states[node].slot == NOWHERE for node in self._situation.bearings if node in states)
        return not self._is_first and rear is not None and rear.slot != NOWHERE and not rear.moving and no_robot_waits

    def _let_out(self, tick: int) -> None:
        """Release a robot, or conclude that the depot is empty if none has come out."""
        if self._released_at is None:
            self.release = True
            self._released_at = tick
            self._released_before = self.released
        elif self.released == self._released_before:
            if tick - self._released_at > RELEASE_TICKS_MAX:
                self.outcome = "depot-dry: the depot is empty"
                self._report_numbers()
        elif not self._homeless() or tick - self._released_at > READY_TICKS_MAX:
            self._released_at = None  # the robot that came out is dead, or was never ready

    def _watch_quiet(self, tick: int) -> None:
        """Conclude from the census once no path has led to a frontier for some time."""
        if not self._situation.clear or self._map.route is not None:
            self._termination.disturb()
            return
        self.outcome = self._termination.quiet(tick, self._situation.motion.samples)
        if self.outcome:
            self._report_numbers()

    def _report_numbers(self) -> None:
        self._situation.telemetry |= {
            "deployment_cycles": self.cycles,
            "pushes": self.pushes,
            "robots_released": self.released,
        }
