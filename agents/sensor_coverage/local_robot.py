"""The decentralised robot: it plans for the edges at itself, and takes part in pushes.

It receives its neighbours' states, broadcasts its own when it changes, and sleeps in between. A push moves it with the
same drives as a coordinator does (`motion.drives`).
"""

from typing import ClassVar

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.local_node import CODECS, LocalNode
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.pushes import (
    AllSettled,
    AllStanding,
    Body,
    Chain,
    LeaderReady,
    PushAborted,
    PushDone,
    PushMessage,
    PushToken,
    SlotVacated,
    TakeSlot,
)
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import WalkResult
from zwerm.agents.sensor_coverage.neighbourhood.beaconing import Beaconing
from zwerm.agents.sensor_coverage.neighbourhood.situation import Situation
from zwerm.agents.sensor_coverage.neighbourhood.surveillance import Surveillance
from zwerm.agents.sensor_coverage.protocols.component import Component
from zwerm.agents.sensor_coverage.protocols.component_loop import ComponentLoop
from zwerm.agents.sensor_coverage.protocols.membership import Membership
from zwerm.agents.sensor_coverage.protocols.redundant_pool import RedundantPool
from zwerm.agents.sensor_coverage.protocols.token_push import TokenPush
from zwerm.agents.sensor_coverage.protocols.transport.delivery import Delivery
from zwerm.agents.sensor_coverage.protocols.transport.vacancy import VacancyAnnouncer
from zwerm.agents.sensor_coverage.protocols.walls.wall_protocol import WallProtocol


class PushParticipant(Component):
    """A robot's part in pushes, one at a time. `pool` exists if robots may leave the complex."""

    accepts: ClassVar[tuple[type, ...]] = (
        PushToken,
        LeaderReady,
        TakeSlot,
        PushAborted,
        AllStanding,
        AllSettled,
        PushDone,
        SlotVacated,
    )

    def __init__(self, situation: Situation, beaconing: Beaconing) -> None:
        self.push: TokenPush | None = None
        self.pool: RedundantPool | None = None
        self.announcer = VacancyAnnouncer(self._is_out)
        self.walls = WallProtocol(situation, self._walk_over)
        self._situation = situation
        self._map = situation.local_map
        self._beaconing = beaconing
        self._over: dict[int, Body | None] = {}  # pushes that are over for this robot, and how they ended
        situation.on_cleared = self._cleared
        situation.on_arrived = self._arrived

    # --- messages -----------------------------------------------------------------------------------------------------

    def receive(self, sender: int, message: PushToken | PushMessage | SlotVacated, tick: int) -> bool:
        """Take in a token, or a message of the present push; return False for news of a push that is not its own."""
        mine = self.push is not None and self.push.id == message.push
        match message:
            case PushToken():
                self._take_token(sender, message, tick)
            case SlotVacated():
                if self.push is None or not mine:
                    return False
                self.push.leader_vacated()
            case _ if self.push is not None and mine:
                self.push.receive(message)
            case TakeSlot() if self._situation.free and self._has_me(message.chain):
                self._join(message.push, NOWHERE, message.chain, None).receive(message)
            case AllSettled() if (end := self._over.get(message.push)) is not None:
                self._situation.mailbox.write(sender, end)  # the sender was out of sight when the push ended
            case _:
                pass
        return True

    def begin_push(self, push: int) -> None:
        """Be the rear of a push that the base has called for."""
        chain = ((self._map.slot, self._situation.node),)
        self._forward(self._join(push, push, chain, None), PushToken(push, push, chain, NOWHERE), self._map.next_hop())

    def _take_token(self, sender: int, token: PushToken, tick: int) -> None:
        """Forward a token along the route, or lead the push if the route ends here."""
        local_map, route = self._map, self._map.route
        here = local_map.slot if local_map.slot != NOWHERE else 0
        left_base = not token.chain and local_map.slot != NOWHERE  # the base does not know yet that this robot has left
        seen = token.push in self._over or self._has_me(token.chain)
        if left_base or seen or local_map.redundant or not self._situation.free:
            self._situation.mailbox.write(sender, PushAborted(token.push, False))
            self._beaconing.repeat(tick)
            return
        chain = (*token.chain, (here, self._situation.node))
        first = not token.chain and token.via == NOWHERE and token.wall_rad is None
        push = self._join(token.push, token.fresh, chain, sender, first)
        if token.wall_rad is not None:
            push.lead_from_base(token.wall_rad, token.hand)
            return
        if first or (route is not None and local_map.has_route and len(route.slots) == 1):
            push.lead()
            return
        via = not token.chain and token.via in self._situation.motion.frame.seen
        onward = PushToken(token.push, token.fresh, chain, NOWHERE)
        self._forward(push, onward, token.via if via else local_map.next_hop())

    def _forward(self, push: TokenPush, token: PushToken, to: int | None) -> None:
        """Send a token to the next robot, or end the push if there is none or it has the token already."""
        visible = to is not None and to in self._situation.motion.frame.seen
        if to is None or not visible or any(node == to for _, node in token.chain):
            self._situation.check_at_base()  # the base sees the first robot of the path
            push.close(PushAborted(token.push, False))
        else:
            push.next = to
            self._situation.mailbox.write(to, token)

    def _join(self, push: int, fresh: int, chain: Chain, back: int | None, first: bool = False) -> TokenPush:
        """Take part in a push."""
        self.push = TokenPush(self._situation, self._announce_vacated, push, fresh, chain, back, first)
        self.push.walls = self.walls
        self.push.relays = self.pool is not None
        self._situation.in_push = True
        return self.push

    def _has_me(self, chain: Chain) -> bool:
        return any(node == self._situation.node for _, node in chain)

    def restarted(self, node: int, tick: int) -> None:
        """Take in that a robot has lost its memory, and with it its part in a push."""
        if self.push is not None:
            self.push.member_lost(node)

    # --- every tick ---------------------------------------------------------------------------------------------------

    def is_idle(self, tick: int) -> bool:
        """Return whether the robot is in no push."""
        return self.push is None

    def poll(self, tick: int) -> None:
        """Take in acknowledgements, and go on with the push."""
        mailbox = self._situation.mailbox
        for bodies, lost in ((mailbox.sent, False), (mailbox.lost, True)):
            for to, body in bodies:
                if lost:
                    self._map.forget(to)
                    if self.pool is not None:
                        self.pool.lost(body)
                if self.push is not None and body.push == self.push.id:
                    self.push.acknowledged(body, lost)
            bodies.clear()
        if self.push is not None:
            self.push.poll()
            if self.push.over:
                self._leave(self.push)

    def next_wake(self) -> int | None:
        """Return the next wake-up of the push."""
        return None if self.push is None else self.push.next_wake()

    def _leave(self, push: TokenPush) -> None:
        self._over[push.id] = push.end
        if self.pool is not None:
            self.pool.push_over(push.id, push.end, push.is_untold)
        self.push, self._situation.in_push = None, False

    def _cleared(self) -> None:
        if self.push is not None:
            self.push.cleared()

    def _walk_over(self, push: int) -> None:
        if self.push is not None and self.push.id == push:
            self.push.walk_ended()

    def _arrived(self, result: DriveResult | WalkResult) -> None:
        if self.push is not None:
            self.push.arrived(result)
        else:
            self._situation.stand()

    def _announce_vacated(self, push: int) -> None:
        self.announcer.announce(push, self._situation.tick)

    def _is_out(self, push: int) -> bool:
        """Return whether this robot leads a push and its followers have not settled yet."""
        return self.push is not None and self.push.id == push and self.push.phase in ("deploying", "out")


class LocalRobot(LocalNode):
    """A robot of the swarm."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        situation = self.situation
        self.pushing = PushParticipant(situation, self.beaconing)
        membership: list[Component] = []
        if situation.negotiation is not None:
            membership = [Membership(situation, situation.negotiation, self.advice_client)]
        if situation.negotiation is not None or self.parameters.walls == "followed":
            self.pushing.pool = RedundantPool(situation, self.pushing.begin_push)
            membership = [*membership, self.pushing.pool]
        self.components = ComponentLoop(
            (
                Delivery(situation.mailbox, lambda *body: self.components.dispatch(*body)),
                self.pushing,
                Surveillance(situation, self.beaconing),
                situation.failure_detector,
                self.beaconing,
                self.pushing.announcer,
                self.pushing.walls,
                *membership,
                self.completion,
                situation.mailbox,
                *([] if self.advice_client is None else [self.advice_client]),
            ),
            CODECS,
            setup.incarnation,
        )

    @property
    def push(self) -> TokenPush | None:
        """The push that the robot takes part in, or None."""
        return self.pushing.push
