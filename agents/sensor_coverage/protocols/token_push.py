"""One robot's part in one push: a token searches the leader, and the robots behind the leader move up.

    token     base to leader, hop by hop: the token locks the path, rear to front
    ready     leader to its follower: the memory of the leader's slot; then the leader drives into unknown space
    abort     leader to base: a wall was in the way, and no robot has moved
    vacated   the leader is far enough away; neighbours forward it, because the follower is out of range
    take      front to rear, each to its follower: the memory of the slot it leaves; each drives once that is acknowledged
    standing  front to rear: all robots ahead of you stand still
    settled   rear to front: all robots behind you have reached their slots; with noise every second one homed before that
    done      front to rear, and to the base

Messages are repeated until they are acknowledged. A robot that waits too long continues alone. That may leave a hole,
which becomes frontier again. If a leader is back and its follower has come all the same, they occupy the old and the
new slot. A leader that a wall stopped may be `ready` again, for another direction.

`PHASES` is the state machine: for each phase, its end conditions, the action at the end of a drive, and the time of the
next wake-up.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import msgspec

from zwerm.agents.sensor_coverage.frontier.directions import wrapped
from zwerm.agents.sensor_coverage.frontier.wall_proof import turned_vector
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import NearWalls, Sighting
from zwerm.agents.sensor_coverage.messages.pushes import (
    AllSettled,
    AllStanding,
    Body,
    LeaderReady,
    PushAborted,
    PushDone,
    PushMessage,
    PushToken,
    SlotMemory,
    TakeSlot,
)
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult
from zwerm.agents.sensor_coverage.motion.push_geometry import direction_to
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import WalkResult
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap
from zwerm.agents.sensor_coverage.neighbourhood.situation import Situation
from zwerm.agents.sensor_coverage.protocols.lead_push import LeadPush
from zwerm.agents.sensor_coverage.protocols.push_part import ARMED_TICKS, LINK_TICKS, LOST_TICKS, WAVE_TICKS, PushPart
from zwerm.agents.sensor_coverage.protocols.walls.wall_push import WallPush


class TokenPush(PushPart, LeadPush, WallPush):
    """One robot's part in one push: what it does on messages, at the end of drives, and at the end of a wait."""

    _situation: Situation
    _map: LocalMap

    @property
    def _is_noisy(self) -> bool:
        """True if one reading of a bearing is not enough."""
        return self._situation.motion.samples > 1

    # --- events -------------------------------------------------------------------------------------------------------

    def receive(self, body: PushMessage) -> None:
        """Take in a message of this push."""
        match body:
            case LeaderReady() if self.phase in ("link", "armed"):
                self._arm(body)
            case TakeSlot():
                self._take_memory(body)
                self._call()
            case PushAborted():
                self.close(body)
            case AllStanding():
                self._ahead_stands = True
                self._near = NearWalls(body.near, body.past_ends)
            case AllSettled():
                self._behind_settled = True
            case PushDone():
                self.close(body)
            case _:
                pass  # the leader tries another direction, and this robot is on its way: it was too late

    def leader_vacated(self) -> None:
        """Take in that the leader has left its slot."""
        if self.phase == "armed":
            self._call()

    def member_lost(self, node: int) -> None:
        """Take in that a robot has lost its memory: wait for it no longer."""
        self._lost[node] = None

    def acknowledged(self, body: Body, lost: bool) -> None:
        """Take in that a message of this robot was acknowledged, or was given up."""
        match body:
            case LeaderReady() if self.phase == "offering":
                if lost:
                    self.close(PushAborted(self.id, False))
                else:
                    self._deploy()
            case TakeSlot() if self.phase == "calling":
                self._follow()
            case PushToken() if lost:
                self.close(PushAborted(self.id, False))
            case PushAborted() | PushDone() if self.phase == "telling":
                self.over = True
            case _:
                pass

    def cleared(self) -> None:
        """Take in that the leader has driven far enough for its follower to take its slot."""
        if not self._vacated and not self._first_bearings:
            self._vacated = True
            self._announce_vacated(self.id)

    def arrived(self, result: DriveResult | WalkResult) -> None:
        """Take in the end of a drive or of a walk."""
        PHASES[self.phase].arrived(self, result)

    def poll(self) -> None:
        """Take the first transition of the present phase that has a true condition."""
        for condition, action in PHASES[self.phase].transitions:
            if condition(self):
                action(self)
                return

    def next_wake(self) -> int:
        """Return the latest tick of the next poll."""
        return PHASES[self.phase].wake(self)

    # --- the leader ---------------------------------------------------------------------------------------------------

    def lead(self) -> None:
        """Be the leader, once this robot's view agrees with its neighbours' states."""
        self._led_at = self._situation.tick
        self._enter("holding")

    def _offer(self) -> None:
        if self._plan is None and not self._first_bearings and self._probes_first():
            return
        behind = self._chain.behind
        if self._first_bearings or (self._plan is not None and behind is None):
            self._deploy()
        elif self._plan is None or behind is None:
            self.close(PushAborted(self.id, self._has_probed))
        else:
            self._enter("offering")
            if self._plan.walk:
                self._map.note_attempt(self._plan)  # before the follower gets the slot's memory
            self._write_ready(behind, self._plan)

    def _deploy(self) -> None:
        if self._plan is not None and self._plan.walk:
            self._approach(self._plan)
            return
        self._enter("deploying")
        parameters = self._map.parameters
        if self._first_bearings:
            bearing_rad = self._first_bearings[0]
            self._situation.deploy(
                bearing_rad, parameters.hop_m, self._situation.clear_m(bearing_rad, parameters.clear_m)
            )
        elif self._plan is not None:
            self._map.note_attempt(self._plan)
            bearing_rad = wrapped(self._plan.direction - self._heading)
            self._situation.deploy(bearing_rad, self._plan.hop_m, self._clear_m(self._plan), self._bounded)

    # --- the followers ------------------------------------------------------------------------------------------------

    def _arm(self, body: LeaderReady) -> None:
        """Wait until the leader has left its slot."""
        self._take_memory(body)
        self._leader_epoch, self._leader_seen_at = body.epoch, self._situation.tick
        self._back_ticks = body.back_ticks if self._chain.leader[1] in self._situation.bearings else 0
        self._enter("armed")

    def _call(self) -> None:
        """Inform the follower, and drive once it has acknowledged."""
        self._enter("calling")
        behind = self._chain.behind
        if behind is None:
            self._follow()
        else:
            taken = TakeSlot(self.id, self._chain.links, self._map.memory(), self._walks)
            self._situation.mailbox.write(behind, taken)

    def _follow(self) -> None:
        """Drive to the slot ahead, and inherit it."""
        memory = self._memory
        if memory is None:
            return
        self._enter("following")
        origin = self._chain.origin
        back_rad = direction_to(memory, origin)
        landmarks = self._chain.landmarks(memory.references, self._chain.future(), self._heading, origin)
        bearing_rad = None if back_rad is None else wrapped(back_rad + math.pi - self._heading)
        measured = {origin: self._map.distances_m[memory.slot]} if memory.slot in self._map.distances_m else {}
        if measured and bearing_rad is None:
            # The former robot at the slot never took the bearing of this one, which was out of the complex.
            bearing_rad = self._ahead_rad
        self._map.inherit(memory)
        self._map.distances_m |= measured
        hop_m = 0.0 if bearing_rad is None else self._map.distances_m.get(origin, self._map.parameters.hop_m)
        self._start = self._situation.motion.position
        self._situation.move(bearing_rad or 0.0, hop_m, landmarks, knows_way=bearing_rad is not None)

    # --- after the drive ----------------------------------------------------------------------------------------------

    def _followed(self, result: DriveResult) -> None:
        self._note_move(result)
        if not (result.used_odometry or result.used_moving_landmarks):
            self._situation.stand()
        self._enter("there")

    def _report_standing(self) -> None:
        self._enter("standing")
        if self._is_noisy and self._stays():
            self._situation.stand()  # others home on it
        if self._near.followed:
            self._map.note_near(self._near)
        if self._chain.is_rear:
            self._behind_settled = True
        else:
            self._write(AllStanding(self.id))

    def _straighten(self) -> None:
        """Correct the distance in a single file, where neither bearings nor a walk determined it, or that is too long."""
        if self._back is not None and (
            self._behind_settled and self._has_lost_behind() if self._is_measured else self._result.used_odometry
        ):
            self._enter("straightening")
            self._situation.correct((Sighting(self._back, self._back_bearing_rad()),))
        else:
            self._home()

    def _home(self) -> None:
        """Repeat the visual homing on landmarks that were moving and stand still now."""
        if self._memory is not None and self._homes_again(self._is_noisy):
            self._begin_homing("homing", self._memory)
        else:
            self._regain()

    def _home_early(self) -> None:
        if self._memory is not None:
            self._begin_homing("homing early", self._memory)

    def _begin_homing(self, phase: str, memory: SlotMemory) -> None:
        self._enter(phase)
        states = self._map.states
        self._map.odometry_moves = 0
        future = self._chain.future()
        moving = {slot: node for slot, node in future.items() if node not in states or states[node].moving}
        still = {slot: node for slot, node in future.items() if slot not in moving}
        references = [msgspec.structs.replace(r, node=still.get(r.slot, r.node)) for r in memory.references]
        self._situation.move(0.0, 0.0, self._chain.landmarks(references, moving, self._heading, NOWHERE))

    def _homed_early(self) -> None:
        """Stand again, and wait until all robots behind have settled."""
        self._result = DriveResult(True)
        self._situation.stand()
        self._enter("standing")

    def _regain(self) -> None:
        """Look for the robot ahead if it is out of sight: it drove from this slot to its own, so both see each other."""
        ahead = self._chain.ahead
        walks = self._walks and ahead == self._chain.leader[1]
        if ahead is None or walks or ahead in self._situation.motion.frame.seen:
            self._return()
        else:
            self._enter("regaining")
            self._situation.regain(ahead)

    def _return(self) -> None:
        """Drive back into sight of the robot behind if no robot is between them: the swarm may hang together by the two."""
        if self._back is not None and self._is_apart():
            self._enter("returning")
            self._situation.come_back_to(self._back)
        else:
            self._settled()

    def _correct(self) -> None:
        self._enter("correcting")
        self._situation.correct(self._anchors)

    def _settled(self) -> None:
        """Stand at the new slot, and inform the robot ahead; the leader ends the push."""
        self._situation.stand()
        ahead = self._chain.ahead
        if self._start is not None and self._chain.origin != NOWHERE:
            x_m, y_m = (now - then for now, then in zip(self._situation.motion.position, self._start, strict=True))
            if self._map.references.take_way(self._chain.origin, turned_vector((x_m, y_m), self._heading)):
                self._map.forget_walls()
        if ahead is None:
            self.close(PushDone(self.id))
            return
        self._situation.mailbox.write(ahead, AllSettled(self.id))
        self._enter("await")

    # --- the end ------------------------------------------------------------------------------------------------------

    def close(self, end: Body) -> None:
        """End the push, once this robot's view agrees with its neighbours' states again."""
        if self._chain.leads and isinstance(end, PushAborted):
            self._map.abandon_push(self._fresh, self._back)
        self.end = end
        self._enter("closing")

    def _may_close(self) -> bool:
        return self._may_finish() and self._is_judged()

    def _finish(self) -> None:
        """Send the outcome of the push to the robot behind; join no other push until that is acknowledged."""
        if self._map.moving:
            self._situation.stand()
        self._leave_if_spare()
        self.over = self.end is None or self._back is None
        if self.end is not None:
            self._write(self.end)
        self._enter("telling")

    def _write(self, body: Body) -> None:
        """Send to the robot behind, or to the sender of the token."""
        if self._back is not None:
            self._situation.mailbox.write(self._back, body)

    def _drop(self) -> None:
        """End without a message: the robot behind is out of range, and its waiting time ends. The base needs the end."""
        self._situation.mailbox.drop(self.id)
        self.is_untold = self._chain.is_rear
        self.over = True


class Phase(NamedTuple):
    """One row of the state machine.

    `transitions` are (condition, action) in order of priority. `arrived` takes the result of a drive that ends in this
    phase. `wake` returns the latest tick of the next poll.
    """

    transitions: tuple[tuple[Callable[[TokenPush], bool], Callable[[TokenPush], None]], ...] = ()
    arrived: Callable[[TokenPush, Any], None] = lambda push, result: push._situation.stand()
    wake: Callable[[TokenPush], int] = lambda push: push._since + WAVE_TICKS + 1


# fmt: off
PHASES: Final[Mapping[str, Phase]] = {
    # The token passes on along the path.
    "link": Phase(((TokenPush._token_is_lost, lambda push: push.close(PushAborted(push.id, False))),),
                  wake=lambda push: push._wake_after(LOST_TICKS if push._waited < LOST_TICKS else LINK_TICKS)),
    # Leader: wait until the local map is right, offer the slot, drive, and wait for the followers.
    "holding": Phase(((TokenPush._may_offer, TokenPush._offer),), wake=TokenPush._next_tick),
    "probing": Phase(arrived=TokenPush._probed),
    "offering": Phase(),
    "deploying": Phase(arrived=TokenPush._deployed),
    "rejoining": Phase(arrived=lambda push, _: push._give_up()),
    "leaving": Phase(arrived=TokenPush._left_station),
    "approaching": Phase(arrived=TokenPush._approached),
    "out": Phase(((TokenPush._settled_behind, TokenPush._go_on),), wake=TokenPush._wake_for_behind),
    "walking": Phase(arrived=TokenPush._walked),
    "correcting": Phase(arrived=lambda push, _: push._return()),
    # Follower of the leader: wait until the leader's slot is vacant.
    "armed": Phase(((lambda push: push._leader_is_back() or push._waited > ARMED_TICKS,
                     lambda push: push.close(PushAborted(push.id, True))),
                    (TokenPush._leader_stays_away, TokenPush._call),
                    (lambda push: push._vacancy_check_due() and push._leader_is_gone(), TokenPush._call)),
                   wake=TokenPush._next_vacancy_check),
    # Followers: let the next one come, drive, and wait until all ahead stand and all behind have settled.
    "calling": Phase(),
    "following": Phase(arrived=TokenPush._followed),
    "there": Phase(((lambda push: push._ahead_stands or push._waited_for_ahead(), TokenPush._report_standing),),
                   wake=TokenPush._wake_for_ahead),
    "standing": Phase(((lambda push: push._homes_early(push._is_noisy), TokenPush._home_early),
                       (TokenPush._settled_behind, TokenPush._straighten)), wake=TokenPush._wake_for_behind),
    "homing early": Phase(arrived=lambda push, _: push._homed_early()),
    "straightening": Phase(arrived=lambda push, _: push._home()),
    "homing": Phase(arrived=lambda push, _: push._regain()),
    "regaining": Phase(arrived=lambda push, _: push._return()),
    "returning": Phase(arrived=lambda push, _: push._settled()),
    "await": Phase(((lambda push: push._walk_over or push._waited_for_ahead(), lambda push: push.close(PushDone(push.id))),),
                   wake=TokenPush._wake_for_ahead),
    # All: wait until the view agrees with the neighbours, inform the robot behind, and end.
    "closing": Phase(((TokenPush._may_close, TokenPush._finish),), wake=TokenPush._next_tick),
    "telling": Phase(((TokenPush._out_of_range, TokenPush._drop),), wake=TokenPush._next_tick),
}
# fmt: on
