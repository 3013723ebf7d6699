"""The common part of a decentralised robot and its base station: the situation, the census, and the loop over components."""

from typing import Final

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.agents.sensor_coverage.frontier.planner import Planner
from zwerm.agents.sensor_coverage.frontier.proofs.slot_proof import SlotProof
from zwerm.agents.sensor_coverage.frontier.wall_proof import mark_of
from zwerm.agents.sensor_coverage.messages import advice, peers
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import INCARNATIONS
from zwerm.agents.sensor_coverage.motion.locomotion import STOP
from zwerm.agents.sensor_coverage.motion.motion_parameters import RobotParameters
from zwerm.agents.sensor_coverage.neighbourhood.beaconing import Beaconing
from zwerm.agents.sensor_coverage.neighbourhood.local_map import FrontierMakers, LocalMap
from zwerm.agents.sensor_coverage.neighbourhood.situation import Situation
from zwerm.agents.sensor_coverage.protocols.advice_client import AdviceClient
from zwerm.agents.sensor_coverage.protocols.component_loop import Codec, ComponentLoop
from zwerm.agents.sensor_coverage.protocols.ending.completion_census import CompletionProtocol
from zwerm.wire.messages import Command, Observation, Wake

CODECS: Final = {
    peers.CHANNEL: Codec(peers.read, peers.write, in_envelopes=True),
    advice.CHANNEL: Codec(advice.read, advice.write),
}
MAKERS: Final = FrontierMakers(Planner, SlotProof)


class LocalNode(Controller):
    """A node without a coordinator. A subclass sets `components`, in the order in which they are polled and send."""

    sensors = ("bearings", "touch", "odometry")
    Parameters = RobotParameters
    components: ComponentLoop

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.random.integers(1, INCARNATIONS)  # not used; keeps the later draws as they were in earlier versions
        self.situation = Situation(setup, self.parameters, self.random, MAKERS)
        self.beaconing = Beaconing(self.situation.local_map, lambda: self.situation.waiting)
        base = setup.role == "base"
        self.completion = CompletionProtocol(setup, self.random, base, lambda: self._takes_census)
        self.advice_client: AdviceClient | None = None
        if setup.services.get("redundancy") == "coordinator":
            self.advice_client = AdviceClient(setup.dt_s)
        self._claimed: bool | None = False if setup.incarnation == 1 else None  # a former one may have claimed
        self._search = 0
        self._wave = 0
        # The tick of the wake-up with which the robot fell asleep; None during an activity.
        self._due: int | None = None

    @property
    def node(self) -> int:
        """The node's id."""
        return self.setup.node

    @property
    def local_map(self) -> LocalMap:
        """The node's map of its neighbourhood."""
        return self.situation.local_map

    def step(self, observation: Observation) -> Command:
        """Observe, receive messages, go on with the activity, poll the components, and send their messages.

        Most packets repeat what the robot knows: neighbours repeat their states, because packets are lost. A robot that
        only such packets have woken sleeps on.
        """
        situation = self.situation
        situation.observe(observation)
        silent, seen = situation.failure_detector.dead, situation.motion.frame.seen
        dead = [node for node in silent if node in seen] if silent else ()
        unproven = situation.local_map.unproven
        self.completion.update(situation.tick, situation.bearings, situation.claims, self._occupied, dead, unproven)
        news = self.components.deliver(observation.inbox, situation.tick)
        if (
            not news
            and self._due is not None
            and situation.tick < self._due
            and self.components.is_idle(situation.tick)
        ):
            return Command(drive=STOP, wake=self._wake_at(self._due))
        velocity = situation.advance()
        if self.completion.search != self._search:
            self._search = self.completion.search
            situation.local_map.reopen()
        self._lose_dead()
        self.components.poll(situation.tick)
        if bool(situation.claims) is not self._claimed:
            self._claimed = bool(situation.claims)
            situation.telemetry["claims_frontier"] = self._claimed
        telemetry, situation.telemetry = situation.telemetry, {}
        snapshot, situation.snapshot = situation.snapshot, b""
        outbox = self.components.outbox(len(snapshot))
        return Command(drive=velocity, outbox=outbox, wake=self._wake(), telemetry=telemetry, snapshot=snapshot)

    def _lose_dead(self) -> None:
        """Forget, once in each wave of the census, what robots saw of walks that it says are dead, wherever they stood.

        A robot that died on its way to a slot counts as moving there, until this one is told.
        """
        if self.completion.wave == self._wave:
            return
        self._wave = self.completion.wave
        dead, proof = self.completion.told_dead, self.local_map.proof
        self.situation.told_dead = dead
        if dead and proof.ready:
            before = proof.open_arcs()
            slots = (self.local_map.slot_of(node) for node in dead)
            proof.lose(*(mark_of(node) for node in dead), *(each for each in slots if each != NOWHERE))
            if proof.open_arcs() != before:
                self.local_map.replan()

    @property
    def _takes_census(self) -> bool:
        """True if the node asks in the census again where answers are missing."""
        return True

    @property
    def _occupied(self) -> bool:
        """True if the node is busy, as the census counts it: a message in flight keeps its sender busy."""
        situation = self.situation
        here = situation.in_push or situation.active or situation.local_map.moving
        return here or situation.homeless or not situation.calm or not situation.mailbox.empty

    def _wake(self) -> Wake | None:
        """Return the next wake-up: the next tick during an activity, else the earliest of the components'."""
        due = None if self.situation.active else self.components.next_wake()
        self._due = due
        return None if due is None else self._wake_at(due)

    def _wake_at(self, due: int) -> Wake:
        """Return the wake-up at a tick, the next one at the earliest, or at a packet."""
        return Wake(at_s=max(self.situation.tick + 1, due) * self.setup.dt_s, on_packet=True)
