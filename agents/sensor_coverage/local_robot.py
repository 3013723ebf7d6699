"""The robot of sensor coverage without a centre: it plans for the edges at itself, and takes part in pushes.

It hears its neighbours' states, tells its own when that changes, and sleeps in between. What it does when it drives is the
same as under a coordinator (`zwerm.agents.sensor_coverage.central_robot`); who tells it to is its neighbour or itself.
"""

import math
from typing import Any, Final

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.central_robot import STOP, CentralRobot, RobotParameters, Story
from zwerm.agents.sensor_coverage.frontier.planner import PlannerParameters as Rules
from zwerm.agents.sensor_coverage.messages.commands import Arrived, Cleared
from zwerm.agents.sensor_coverage.messages.peers import (
    CHANNEL,
    NOWHERE,
    Body,
    PathVector,
    PushAborted,
    PushToken,
    RedundantCall,
    RedundantOffer,
    RedundantPushEnd,
    Segment,
    SegmentAck,
    SlotVacated,
    StateBeacon,
    StateRequest,
    TakeSlot,
    Word,
    read,
    write,
)
from zwerm.agents.sensor_coverage.motion.homing import Vector
from zwerm.agents.sensor_coverage.neighbourhood.beaconing import Beaconing
from zwerm.agents.sensor_coverage.neighbourhood.failure_detector import FailureDetector
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap
from zwerm.agents.sensor_coverage.protocols.census import CensusTally, CensusWave
from zwerm.agents.sensor_coverage.protocols.completion import CompletionProtocol
from zwerm.agents.sensor_coverage.protocols.mailbox import ReliableMailbox
from zwerm.agents.sensor_coverage.protocols.membership import Membership
from zwerm.agents.sensor_coverage.protocols.push_host import Drive
from zwerm.agents.sensor_coverage.protocols.token_push import TokenPush
from zwerm.wire.messages import Command, Observation, Transmission, Wake

# How long a robot may be unsure whether it is at the frontier before it says so: most pushes beside it are over before.
DOUBT_TICKS: Final = 100
# How often the news that a leader is gone is told, and told on.
GONE_HOPS: Final = 2
GONE_TICKS: Final = 4


class LocalRobot(CentralRobot):
    """A robot of the swarm."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        p: RobotParameters = self.parameters
        self.rules = Rules(link_m=p.link_m, margin_m=p.margin_m)
        self.tick = 0
        self.post = ReliableMailbox()
        self.vicinity = LocalMap(setup.node, self.rules)
        self.speech = Beaconing(setup.node)
        self.push: TokenPush | None = None
        self._over: dict[int, None] = {}
        self._letters: list[Transmission] = []
        self._told_on: dict[int, int] = {}
        self._gone: tuple[int, int, int] | None = None  # the push whose leader this was, when to say so, when again
        self.inquiry = FailureDetector()
        self._rest = 0.0, 0.0
        self._watched: object = None
        self._calm = self._claimed = False
        self._doubts_at: int | None = None
        self._chosen = 0
        self._told: dict[str, Any] = {}
        self.drives = False
        self.ending = CompletionProtocol(setup, self.random, base=setup.role == "base")
        self.membership = Membership(self, setup, self.random)
        self._story = self._look_around()

    # --- one tick ---------------------------------------------------------------------------------------------------

    def step(self, observation: Observation) -> Command:
        """Hear, go on with the present drive, and say what is new."""
        self.tick = observation.tick
        self.senses.take(observation)
        self.membership.watch(self.senses.seen)
        self.ending.note(self.tick, self.bearings, self._claims, self._occupied)
        for packet in observation.inbox:
            self.membership.advise(packet)
            word = read(packet.payload) if packet.channel == CHANNEL and packet.sender is not None else None
            if word is not None and packet.sender is not None:
                self._hear(packet.sender, word)
        drive = self._go_on()
        self._take_part()
        if not self.vicinity.moving:
            self._keep_watch()
        self._told |= self.membership.turn(self.senses.seen)
        if bool(self._claims) != self._claimed:
            self._claimed = bool(self._claims)
            self._told["frontier"] = {"claimed": self._claimed}
        self._say()
        outbox, self._letters = tuple(self._letters), []
        told, self._told = self._told, {}
        return Command(drive=drive, outbox=outbox, wake=self._wake(), told=told)

    def _go_on(self) -> Any:
        drive = STOP
        if self._story is not None:
            try:
                drive = next(self._story)
            except StopIteration:
                self._story = None
        self.drives = drive != STOP
        events, self._outbox = self._outbox, []
        for event in events:
            if self.push is not None and isinstance(event, Cleared):
                self.push.cleared()
            elif isinstance(event, Arrived):
                self._arrived(event)
        return drive

    def _arrived(self, arrived: Arrived) -> None:
        if self.push is not None:
            self.push.arrived(arrived)
        else:
            self.rest()

    def _take_part(self) -> None:
        """Go on with the push that this robot is part of."""
        for letters, lost in ((self.post.sent, False), (self.post.lost, True)):
            for to, body in letters:
                if lost:
                    self.vicinity.forget(to)
                    self.membership.lost(body)
                if self.push is not None and body.push == self.push.id:
                    self.push.acknowledged(body, lost)
            letters.clear()
        if self.push is not None:
            self.push.turn()
        if self.push is not None and self.push.over:
            self._over[self.push.id] = None
            self.membership.over(self.push)
            self.push = None

    def _wake(self) -> Wake | None:
        if self._story is not None:
            return None
        doubts = self._doubts_at if self._doubts_at is not None and self._doubts_at > self.tick else None
        push = self.push.next_tick() if self.push is not None else None
        times = [self.speech.next_tick(), *self.membership.next_ticks()]
        times += [
            each
            for each in (
                *(self.post.next_tick(), push, self.inquiry.at, self.vicinity.awaits_until),
                *(doubts, self.ending.next_tick()),
            )
            if each is not None
        ]
        if self._gone is not None:
            times.append(self._gone[1])
        return Wake(at_s=max(self.tick + 1, min(times)) * self.setup.dt_s, on_packet=True)

    # --- what it hears ----------------------------------------------------------------------------------------------

    def _hear(self, sender: int, word: Word) -> None:
        match word:
            case PathVector():
                self.vicinity.gradient.hear(sender, word)
            case StateBeacon():
                self.vicinity.gradient.hear(sender, word.way)
                if self.inquiry.answered(sender):
                    self.vicinity.change()
                if self.vicinity.missed(sender, word):
                    self.speech.missed(self.tick)
                if self.vicinity.hear(sender, word, self.tick):
                    self.senses.forget((sender,))
            case StateRequest():
                if not word.nodes or self.setup.node in word.nodes:
                    self.speech.again(self.tick)
            case SlotVacated():
                self._hear_gone(word)
            case Segment():
                receipt, body = self.post.take(sender, word)
                self._send(receipt, sender)
                if body is not None:
                    self._read(sender, body)
            case SegmentAck():
                self.post.acknowledge(sender, word)
            case CensusWave() | CensusTally():
                self.ending.hear(sender, word)
            case _:
                self.membership.hear(sender, word)

    def _hear_gone(self, word: SlotVacated) -> None:
        if self.push is not None and self.push.id == word.push:
            self.push.hear_gone()
        if word.hops and self.tick >= self._told_on.get(word.push, 0):
            self._told_on[word.push] = self.tick + 2 * GONE_TICKS
            self._send(SlotVacated(word.push, word.hops - 1))

    def _read(self, sender: int, body: Body) -> None:
        if isinstance(body, PushToken):
            self._take_token(sender, body)
        elif isinstance(body, RedundantOffer | RedundantCall | RedundantPushEnd):
            self.membership.read(body)
        elif self.push is not None and body.push == self.push.id:
            self.push.take(body)
        elif isinstance(body, TakeSlot) and self._free and any(node == self.setup.node for _, node in body.chain):
            self.push = TokenPush(self, body.push, NOWHERE, body.chain, None)
            self.push.take(body)

    @property
    def _free(self) -> bool:
        return self._idle and not self.membership.locked

    @property
    def _idle(self) -> bool:
        return self.push is None and not self.vicinity.moving and self.vicinity.heading is not None

    def _take_token(self, sender: int, token: PushToken) -> None:
        """Pass a token on along the gradient, or lead the push if it ends here."""
        vicinity = self.vicinity
        here = vicinity.place if vicinity.place != NOWHERE else 0
        # It is not at the base any more, and the base has not heard.
        lost = not token.chain and vicinity.place != NOWHERE
        seen = token.push in self._over or any(node == self.setup.node for _, node in token.chain)
        if lost or seen or vicinity.spare or not self._free:
            self.post.write(sender, PushAborted(token.push, False))
            self.speech.again(self.tick)
            return
        chain = (*token.chain, (here, self.setup.node))
        first = not token.chain and token.via == NOWHERE
        self.push = TokenPush(self, token.push, token.fresh, chain, sender, first)
        route = vicinity.route
        onward = token.via if not token.chain and token.via in self.senses.seen else vicinity.onward()
        if first or (route is not None and vicinity.leads and len(route.places) == 1):
            self.push.lead()
        elif onward is None or onward not in self.senses.seen or any(node == onward for _, node in chain):
            self.push.take(PushAborted(token.push, False))
        else:
            self.post.write(onward, PushToken(token.push, token.fresh, chain, NOWHERE))

    # --- what it says -----------------------------------------------------------------------------------------------

    def _send(self, word: Word, to: int | None = None) -> None:
        self._letters.append(Transmission(CHANNEL, write(word), to))

    def _say(self) -> None:
        for word in self.speech.say(self.tick, self.vicinity, self._waiting):
            self._send(word)
        if self._gone is not None and self.tick >= self._gone[1]:
            push, _, wait = self._gone
            self._gone = push, self.tick + wait, 2 * wait
            self._send(SlotVacated(push, GONE_HOPS))
            if self.push is None or self.push.id != push or self.push.phase not in ("deploying", "out"):
                self._gone = None
        for to, word in (*self.membership.letters(), *self.ending.letters(self._takes_census)):
            self._send(word, to)
        for to, letter in self.post.due(self.tick):
            self._send(letter, to)
        self._letters += self.membership.uplink()

    @property
    def _takes_census(self) -> bool:
        return True

    @property
    def _claims(self) -> int:
        return len(self.vicinity.plans) + len(self.vicinity.gaps)

    @property
    def _occupied(self) -> bool:
        """Whether it moves, is part of a push, has a letter that was not acknowledged, or does not know its neighbours."""
        here = self.push is not None or self._story is not None or self.vicinity.moving
        return here or not self._calm or self.post.next_tick() is not None

    @property
    def _waiting(self) -> bool:
        return self.vicinity.place == NOWHERE and self._idle

    # --- standing still ---------------------------------------------------------------------------------------------

    def _keep_watch(self) -> None:
        """Look around when somebody has come or gone, ask for words that are missing, and find out where to expand."""
        vicinity = self.vicinity
        if self._story is None:
            away = 0.0
            if self._rest is not None:
                away = math.hypot(self.senses.x_m - self._rest[0], self.senses.y_m - self._rest[1])
            pushed = away > 2.0 * self.parameters.tolerance_m and not self.membership.locked
            if self._rest is not None and pushed:
                self._story = self._recover(self._rest)  # it was pushed aside
            elif self._unsure():
                self._story = self._look_around()
        watched = vicinity.version, tuple(self.senses.seen), self._story is None
        times = self.inquiry.at, vicinity.awaits_until, self._doubts_at, self.speech.heartbeat
        timers = [each for each in times if each is not None]
        if watched != self._watched or self.tick >= min(timers):
            self._watched = watched
            vicinity.part()
            vicinity.find_heading()
            vicinity.learn_references()
            # Places outlive who stands there: while they change hands the frontier and the way to it stay as they were.
            self._calm = not (self.busy or vicinity.changing(self.bearings, self.tick))
            self._doubts_at = None if self._calm else self._doubts_at or self.tick + DOUBT_TICKS
            if self._calm:
                vicinity.plan()
            ask = self.inquiry.turn(self.tick, vicinity, self.senses.seen, self._samples)
            if ask is not None:
                self._send(ask)
        elif vicinity.gradient.version == self._chosen:
            return  # nothing is new, so nothing follows
        self._chosen = vicinity.gradient.version
        if self._calm:
            vicinity.find_route(self.tick)
        elif self._doubts_at is not None and self.tick >= self._doubts_at:
            vicinity.doubt(self.tick)

    def _recover(self, rest: Vector) -> Story:
        self._rest = yield from self._return(rest)

    def _standing(self) -> list[int]:
        """Return whom it sees, but for robots that are on their way."""
        states = self.vicinity.states
        return [node for node in self.senses.seen if node not in states or not states[node].moving]

    def _unsure(self) -> bool:
        """Tell whether somebody in sight was not averaged, or somebody out of sight was."""
        wanted = 1 if self._noise_rad is None else self._samples
        standing = self._standing()
        gone = any(node not in self.senses.seen for node in self.vicinity.seen)
        return gone or not self.vicinity.samples or any(self.senses.count(node) < wanted for node in standing)

    def _look_around(self) -> Story:
        """Stand still until everyone in sight that stands has been averaged."""
        for _ in range(2 * self._samples):
            self.senses.average()
            if all(self.senses.count(node) >= self._samples for node in self._standing()):
                break
            yield STOP
        if self._noise_rad is None:
            self._noise_rad = self.senses.spread()
        standing = frozenset(self._standing())
        self.vicinity.look({s.node: s.bearing_rad for s in self.senses.sightings() if s.node in standing})
        self.vicinity.touch(self.senses.touched)

    # --- what pushes need -------------------------------------------------------------------------------------------

    @property
    def ready(self) -> bool:
        """Whether it can take part in a push."""
        return self._free

    def begin(self, push: int) -> None:
        """Be the rear of a push; the base has called."""
        chain = ((self.vicinity.place, self.setup.node),)
        self.push = TokenPush(self, push, push, chain, None)
        onward = self.vicinity.onward()
        if onward is None or onward not in self.senses.seen:
            self.push.take(PushAborted(push, False))
        else:
            self.post.write(onward, PushToken(push, push, chain, NOWHERE))

    @property
    def node(self) -> int:
        """The robot's id."""
        return self.setup.node

    @property
    def busy(self) -> bool:
        """Whether it drives, or looks around."""
        return self._story is not None or self._unsure()

    @property
    def bearings(self) -> dict[int, float]:
        """Whom it sees now, but for the dead."""
        return {node: bearing for node, bearing in self.senses.seen.items() if node not in self.inquiry.dead}

    @property
    def clear(self) -> bool:
        """Whether it stands, has looked around, and nobody about it is on the way."""
        return not self.busy and not self.vicinity.changing(self.bearings, self.tick)

    def drive(self, order: Drive) -> None:
        """Begin a drive."""
        self.vicinity.go()
        self._story = self._begin(order)

    def rest(self) -> None:
        """Stand again, for neighbours to look at."""
        self.vicinity.rest()
        self.senses.forget()

    def tell_gone(self, push: int) -> None:
        """Broadcast that this leader is gone, until the push goes on."""
        self._gone = push, self.tick, GONE_TICKS
