"""One push, as each robot of its path lives it: a token goes out along the gradient, and robots move up behind its leader.

    token       base to leader, hop by hop: the path, rear to front, is locked by it
    ready       leader to its follower: the memory of the leader's place; then the leader goes into the unknown
    abort       leader to base: a wall was in the way, nobody has moved
    gone        the leader is far enough away; told on by neighbours, since its follower is out of its reach
    take        front to rear, each to its follower: the memory of the place it leaves; each goes once it was acknowledged
    stand       front to rear: all ahead of you stand
    settled     rear to front: all behind you have found their places
    done        front to rear, and the base

Letters are sent again until they are acknowledged. Who hears nothing for too long goes on alone: that may leave a hole, which
becomes frontier again; and a leader that is back, and its follower beside it after all, take the two names that the push has.
"""

import math
from collections.abc import Sequence
from typing import Final

import msgspec

from zwerm.agents.sensor_coverage.frontier.services import Plan
from zwerm.agents.sensor_coverage.messages.commands import Arrived, Correct, Deploy, Landmark, Move, Sighting
from zwerm.agents.sensor_coverage.messages.peers import (
    NOWHERE,
    AllSettled,
    AllStanding,
    Body,
    Chain,
    LeaderReady,
    PushAborted,
    PushDone,
    PushToken,
    ReferenceBearing,
    SlotMemory,
    TakeSlot,
)
from zwerm.agents.sensor_coverage.protocols.push_host import PushHost

# How long to wait for what others do [ticks]: a path to be walked twice, a drive, a look around.
LINK_TICKS: Final = 1000
WAVE_TICKS: Final = 600
GONE_TICKS: Final = 80
ARMED_TICKS: Final = 300
HOLD_TICKS: Final = 600
LOST_TICKS: Final = 100
CLOSE_TICKS: Final = 80
TOLD_TICKS: Final = 4

# A leader is still at its place, or back, if it is seen that near to the place's direction [rad].
BACK_RAD: Final = 0.3

# The bearings to try from the base, when nobody is out yet.
FIRST_RAD: Final = (0.0, math.pi / 2.0, -math.pi / 2.0, math.pi)


class TokenPush:
    """One robot's part in one push. `over` once it is done with; `end` is how it ended, as far as this robot knows."""

    def __init__(
        self, host: PushHost, push: int, fresh: int, chain: Chain, back: int | None, first: bool = False
    ) -> None:
        self.id = push
        self.phase = "link"
        self.over = False
        self.since = host.tick
        self._host = host
        self._fresh = fresh
        self._chain = chain
        self._index = next(n for n, (_, node) in enumerate(chain) if node == host.node)
        self._back = back if self._index == 0 else chain[self._index - 1][1]
        self._memory: SlotMemory | None = None
        self._plan: Plan | None = None
        self._first = list(FIRST_RAD) if first else []
        self._gone = False
        self._ahead_stands = self._behind_settled = False
        self._loose = self._leaned = False
        self.end: Body | None = None
        self._epoch = -1

    # --- what comes -------------------------------------------------------------------------------------------------

    def take(self, body: Body) -> None:
        """Take in a letter of this push."""
        match body:
            case LeaderReady():
                self._chain, self._memory = body.chain, body.memory
                self._epoch = body.epoch
                self._enter("armed")
            case TakeSlot():
                self._chain, self._memory = body.chain, body.memory
                self._call()
            case PushAborted():
                self._close(body)
            case AllStanding():
                self._ahead_stands = True
            case AllSettled():
                self._behind_settled = True
            case PushDone():
                self._close(body)

    def hear_gone(self) -> None:
        """The leader is gone."""
        if self.phase == "armed":
            self._call()

    def acknowledged(self, body: Body, lost: bool) -> None:
        """A letter has arrived, or has not and never will."""
        match body:
            case LeaderReady() if self.phase == "offering":
                if lost:
                    self._close(PushAborted(self.id, False))
                else:
                    self._deploy()
            case TakeSlot() if self.phase == "calling":
                self._follow()
            case PushToken() if lost:
                self._close(PushAborted(self.id, False))
            case PushAborted() | PushDone() if self.phase == "telling":
                self.over = True
            case _:
                pass

    # --- the leader -------------------------------------------------------------------------------------------------

    def lead(self) -> None:
        """Be the leader, once this robot's word of its neighbours is good."""
        self._enter("holding")

    def _offer(self) -> None:
        host, vicinity = self._host, self._host.vicinity
        plan = vicinity.best()
        if self._first:
            self._enter("deploying")
            self._deploy()
            return
        if plan is None:
            self._close(PushAborted(self.id, False))
            return
        self._plan = plan
        if self._index == 0:
            self._deploy()
            return
        self._enter("offering")
        host.post.write(
            self._chain[self._index - 1][1], LeaderReady(self.id, self._chain, vicinity.memory(), vicinity.epoch)
        )

    def _deploy(self) -> None:
        rules, vicinity = self._host.vicinity.rules, self._host.vicinity
        self._enter("deploying")
        if self._first:
            hop_m = rules.link_m - rules.margin_m
            self._host.drive(Deploy(0, self._first[0], hop_m, rules.clear_m))
        elif self._plan is not None:
            vicinity.note_attempt(self._plan)
            bearing = math.remainder(self._plan.direction - self._heading, math.tau)
            self._host.drive(Deploy(0, bearing, self._plan.hop_m, self._plan.clear_m))

    def cleared(self) -> None:
        """The leader has come far enough."""
        if not self._gone and not self._first:
            self._gone = True
            self._host.tell_gone(self.id)

    def _deployed(self, arrived: Arrived) -> None:
        vicinity = self._host.vicinity
        if not arrived.ok:
            if self._plan is not None:
                vicinity.note_failure(self._plan, arrived.driven_m)
            elif len(self._first) > 1:
                del self._first[0]
                self._deploy()
                return
            self._host.rest()
            self._close(PushAborted(self.id, True))
            return
        self._anchors = self._who_anchors()
        vicinity.found(self._fresh)
        if self._first:
            vicinity.heading = 0.0
            self._correct(self._anchors)
            return
        self._enter("out")
        self._write(AllStanding(self.id))

    def _who_anchors(self) -> tuple[Sighting, ...]:
        """Return whom to hold on to, and where each should about be."""
        if self._first:
            return (Sighting(self._back or 0, math.remainder(self._first[0] + math.pi, math.tau)),)
        if self._plan is None:
            return ()
        back = math.remainder(self._plan.direction + math.pi - self._heading, math.tau)
        future = self._future()
        nodes = [future.get(place, self._host.vicinity.at(place)) for place in self._plan.anchors]
        return tuple(Sighting(node, back) for node in nodes if node is not None)

    # --- the followers ----------------------------------------------------------------------------------------------

    def _call(self) -> None:
        """Let who is behind come, and go once it knows."""
        self._enter("calling")
        if self._index == 0:
            self._follow()
            return
        self._host.post.write(
            self._chain[self._index - 1][1], TakeSlot(self.id, self._chain, self._host.vicinity.memory())
        )

    def _follow(self) -> None:
        memory = self._memory
        if memory is None:
            return
        self._enter("following")
        origin = self._chain[self._index][0]
        there = next((each.direction_rad + math.pi for each in memory.references if each.place == origin), None)
        landmarks = self._landmarks(memory.references, self._future(), origin)
        rules = self._host.vicinity.rules
        heading, hop_m = self._heading, rules.link_m - rules.margin_m
        if there is None:
            there, hop_m = heading, 0.0
        self._host.vicinity.enter(memory)
        self._host.drive(Move(0, math.remainder(there - heading, math.tau), hop_m, landmarks))

    def _future(self) -> dict[int, int]:
        """Return who will be where among the places that change hands."""
        chain = self._chain
        return {place: before for (place, _), (_, before) in zip(chain[1:], chain[:-1], strict=True)}

    def _landmarks(
        self, references: Sequence[ReferenceBearing], future: dict[int, int], origin: int
    ) -> tuple[Landmark, ...]:
        heading, rear = self._heading, self._chain[0][0]
        found = []
        for each in references:
            node = future.get(each.place, each.node)
            if node == self._host.node or (each.place == rear and rear not in (0, NOWHERE)):
                continue
            bearing = math.remainder(each.direction_rad - heading, math.tau)
            found.append((each.place, Landmark(node, bearing, each.place not in future)))
        if origin == 0 and sum(each.still for _, each in found) > 2:
            found = [each for each in found if each[0] != 0]
        return tuple(each for _, each in found)

    # --- the end ----------------------------------------------------------------------------------------------------

    def arrived(self, arrived: Arrived) -> None:
        """A drive of this push is over."""
        match self.phase:
            case "deploying":
                self._deployed(arrived)
            case "following":
                self._loose, self._leaned = arrived.loose, arrived.leaned
                if not (self._loose or self._leaned):
                    self._host.rest()
                self._enter("there")
            case "straightening":
                self._home()
            case "homing" | "correcting":
                self._settled()
            case _:
                self._host.rest()

    def turn(self) -> None:
        """Go on, if what was waited for has come, or never will."""
        waited = self._host.tick - self.since
        match self.phase:
            case "link" if waited > LINK_TICKS:
                self._finish()
            case "holding":
                if self._host.clear or waited > HOLD_TICKS:
                    self._host.vicinity.plan()
                    self._offer()
            case "armed" if self._leader_epoch() > self._epoch or waited > ARMED_TICKS:
                self._close(PushAborted(self.id, True))  # it is back, and its word that it failed was lost
            case "armed" if waited > GONE_TICKS and waited % 20 == 1 and self._vacant():
                self._call()
            case "there" if self._ahead_stands or waited > self._patience(self._index + 1):
                self._enter("standing")
                if self._index:
                    self._write(AllStanding(self.id))
                else:
                    self._behind_settled = True
            case "standing" if self._behind_settled or waited > self._patience(self._index - 1):
                self._straighten()
            case "out" if self._behind_settled or waited > self._patience(self._index - 1):
                self._correct(self._anchors)
            case "await" if waited > self._patience(self._index + 1):
                self._close(PushDone(self.id))
            case "telling" if self._index and waited > TOLD_TICKS and self._back not in self._host.bearings:
                self._host.post.drop(self.id)  # out of reach; it finds out by itself that it is over
                self.over = True
            case "closing":
                leads = self._index == len(self._chain) - 1  # others hear of its drive's end first
                if (self._host.clear and waited > leads) or waited > CLOSE_TICKS:
                    self._finish()
            case _:
                pass

    def next_tick(self) -> int | None:
        """Return when to be looked after, at the latest."""
        match self.phase:
            case "link":
                return self.since + LINK_TICKS + 1
            case "holding" | "closing" | "telling":
                return self._host.tick + 1
            case "there" | "await":
                return max(self._host.tick + 1, self.since + self._patience(self._index + 1) + 1)
            case "standing" | "out":
                return max(self._host.tick + 1, self.since + self._patience(self._index - 1) + 1)
            case "armed":
                waited = self._host.tick - self.since
                return self.since + max(GONE_TICKS + 1, (waited // 20 + 1) * 20 + 1)
            case _:
                return self.since + WAVE_TICKS + 1

    def _leader_epoch(self) -> int:
        """Return since which drive the leader stands at its place, as far as is known."""
        place, leader = self._chain[-1]
        state = self._host.vicinity.states.get(leader)
        return -1 if state is None or state.moving or state.place != place else state.epoch

    def _patience(self, index: int) -> int:
        """Return how long to wait for a letter of one of the path: not long for one who is out of sight and so of reach."""
        there = 0 <= index < len(self._chain) and self._chain[index][1] in self._host.bearings
        return WAVE_TICKS if there else LOST_TICKS

    def _vacant(self) -> bool:
        """Tell whether the leader is out of sight, or beside its place: its word that it is gone was lost."""
        memory, leader = self._memory, self._chain[-1][1]
        if memory is None or leader not in self._host.bearings:
            return True
        me = self._chain[self._index][0]
        there = next((each.direction_rad + math.pi for each in memory.references if each.place == me), None)
        seen = self._host.bearings[leader] + self._heading
        return there is not None and abs(math.remainder(there - seen, math.tau)) > BACK_RAD

    def _straighten(self) -> None:
        """In single file bearings did not tell how far to go, the range of sight does."""
        rear = self._back if self._index == 0 else self._chain[self._index - 1][1]
        if self._loose and rear is not None:
            self._enter("straightening")
            self._host.drive(Correct(0, (Sighting(rear, self._behind()),)))
        else:
            self._home()

    def _behind(self) -> float:
        """Return the bearing at which whoever has taken this robot's former place should about be."""
        references = self._memory.references if self._memory is not None else ()
        origin = self._chain[self._index][0]
        there = next((each.direction_rad for each in references if each.place == origin), self._heading)
        return math.remainder(there - self._heading, math.tau)

    def _home(self) -> None:
        """Who leaned on moving robots finds its place again, now that they stand."""
        states = self._host.vicinity.states
        if not self._leaned or self._memory is None:
            self._settled()
            return
        self._enter("homing")
        moving = {p: n for p, n in self._future().items() if n not in states or states[n].moving}
        still = {p: n for p, n in self._future().items() if p not in moving}
        references = [msgspec.structs.replace(r, node=still.get(r.place, r.node)) for r in self._memory.references]
        self._host.drive(Move(0, 0.0, 0.0, self._landmarks(references, moving, NOWHERE)))

    def _correct(self, anchors: Sequence[Sighting]) -> None:
        self._enter("correcting")
        self._host.drive(Correct(0, tuple(anchors)))

    def _settled(self) -> None:
        self._host.rest()
        if self._index == len(self._chain) - 1:
            self._close(PushDone(self.id))
            return
        self._host.post.write(self._chain[self._index + 1][1], AllSettled(self.id))
        self._enter("await")

    def _close(self, end: Body) -> None:
        """Tell who is behind how it ended, once this robot's word of its neighbours is good again."""
        if self._index == len(self._chain) - 1 and isinstance(end, PushAborted):
            self._host.vicinity.stay(self._fresh, self._back)
        self.end = end
        self._enter("closing")

    def _finish(self) -> None:
        """Tell it, and stay out of other pushes until that was heard."""
        if self._host.vicinity.moving:
            self._host.rest()
        self.over = self.end is None or self._back is None
        if self.end is not None:
            self._write(self.end)
        self._enter("telling")

    # --- means ------------------------------------------------------------------------------------------------------

    def _enter(self, phase: str) -> None:
        self.phase, self.since = phase, self._host.tick

    def _write(self, body: Body) -> None:
        if self._back is not None:
            self._host.post.write(self._back, body)

    @property
    def _heading(self) -> float:
        return self._host.vicinity.heading or 0.0
