"""The decentralised base station: it starts pushes while its route leads to a frontier, and decides when all is covered."""

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.local_node import CODECS, LocalNode
from zwerm.agents.sensor_coverage.neighbourhood.surveillance import Surveillance
from zwerm.agents.sensor_coverage.protocols.component import Component
from zwerm.agents.sensor_coverage.protocols.component_loop import ComponentLoop
from zwerm.agents.sensor_coverage.protocols.ending.termination import COVERED
from zwerm.agents.sensor_coverage.protocols.membership import Membership
from zwerm.agents.sensor_coverage.protocols.push_scheduler import PushScheduler
from zwerm.agents.sensor_coverage.protocols.transport.delivery import Delivery
from zwerm.agents.sensor_coverage.protocols.walls.wall_protocol import WallProtocol
from zwerm.wire.messages import Command, Observation, Wake


class LocalBase(LocalNode):
    """A robot that never moves; its depot is its only actuator."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        situation = self.situation
        situation.local_map.slot = 0
        situation.local_map.heading = 0.0
        self.schedule = PushScheduler(situation, self.beaconing, self.completion)
        membership: list[Component] = []
        if situation.negotiation is not None:
            membership = [Membership(situation, situation.negotiation, self.advice_client)]
        self.components = ComponentLoop(
            (
                Delivery(situation.mailbox, lambda *body: self.components.dispatch(*body)),
                self.schedule,
                Surveillance(situation, self.beaconing),
                situation.failure_detector,
                self.beaconing,
                WallProtocol(situation),
                *membership,
                self.completion,
                situation.mailbox,
                *([] if self.advice_client is None else [self.advice_client]),
            ),
            CODECS,
            setup.incarnation,
        )

    def step(self, observation: Observation) -> Command:
        """Step as a robot that cannot drive, release robots, and end the run with the outcome."""
        schedule = self.schedule
        schedule.see([each.node for each in observation.bearings or ()])
        command = super().step(observation)
        command.drive = None
        command.release, schedule.release = schedule.release, False
        command.done = schedule.outcome == COVERED
        command.gave_up = "" if schedule.outcome in ("", COVERED) else schedule.outcome
        return command

    @property
    def _takes_census(self) -> bool:
        return self.schedule.takes_census

    @property
    def _occupied(self) -> bool:
        return super()._occupied or not self._takes_census

    def _wake(self) -> Wake | None:
        """Return the next wake-up: between pushes the next tick, and always when a robot comes into sight."""
        wake = super()._wake()
        if wake is None or self.schedule.outcome:
            return wake
        at_s = (self.situation.tick + 1) * self.setup.dt_s if self.schedule.idle else wake.at_s
        return Wake(at_s=at_s, on_packet=True, on_visible=True)
