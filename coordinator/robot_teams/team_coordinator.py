"""The coordinator of coverage by robot teams: it plans the cells of all robots from their messages.

It leads one team of all robots in reach, with the same decisions as the lead of any team. It has no body. Robots learn
of one another only from its beacons. It never divides the team: free robots take the nearest open cells.
"""

from typing import Annotated, Final, Protocol

import msgspec
from msgspec import Meta, Struct

from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.protocols.central_membership import CoordinatorMembership
from zwerm.agents.robot_teams.protocols.fact_exchange import FactExchange
from zwerm.agents.robot_teams.protocols.team_messages import TeamBeacon, read_beacon, write_beacon
from zwerm.agents.robot_teams.task_end import reason
from zwerm.agents.robot_teams.team_lead import TeamLead, findings
from zwerm.wire.messages import Command, Observation, Transmission

# Time that the coordinator waits for the robots' first reports [s], and ticks between its decisions after that.
GATHER_S: Final = 1.0
DECIDE_TICKS: Final = 4


class TeamCoordinatorTable(Struct, frozen=True, forbid_unknown_fields=True):
    """Its sending period, the silence after which it drops a robot, and the distance that robots go to join a corridor
    while others work."""

    beacon_s: Annotated[float, Meta(gt=0.0)] = 0.25
    silence_s: Annotated[float, Meta(gt=0.0)] = 6.0
    one_corridor: bool = False
    join_m: Annotated[float, Meta(gt=0.0)] = 6.0


class TeamCoordinatorSetup(Protocol):
    """The part of its setup that the coordinator needs."""

    @property
    def node(self) -> int:
        """Its id."""

    @property
    def dt_s(self) -> float:
        """The length of a tick [s]."""

    @property
    def parameters(self) -> dict[str, object]:
        """The parameters from the scenario."""


class TeamCoordinator:
    """Leads all robots."""

    Parameters = TeamCoordinatorTable

    def __init__(self, setup: TeamCoordinatorSetup) -> None:
        table = msgspec.convert(setup.parameters, TeamCoordinatorTable)
        self.map = SliceMap()
        self.membership = CoordinatorMembership(setup.node, setup.dt_s, table.silence_s)
        self.lead = TeamLead(
            self.map,
            self.membership,
            setup.dt_s,
            divide=False,
            merge=False,
            one_corridor=table.one_corridor,
            join_m=table.join_m,
        )
        self.refused = 0
        self._node = setup.node
        self._exchange = FactExchange(self.map, setup.dt_s)
        self._view = self.membership.view
        self._gather_ticks = round(GATHER_S / setup.dt_s)
        self._every = max(1, round(table.beacon_s / setup.dt_s))
        self._reported = -1, False

    def step(self, observation: Observation) -> Command:
        """Receive, decide, and send."""
        tick = observation.tick
        for packet in observation.inbox:
            beacon = read_beacon(packet.payload)
            if beacon is None:
                self.refused += 1
                continue
            self.membership.receive(beacon, tick, near=False)
            self._exchange.receive(beacon, tick)
        urgent = False
        if tick >= self._gather_ticks:
            self.membership.poll(tick)
            if self.membership.view != self._view:
                self._view = self.membership.view
                self.lead.begin(tick)
                urgent = True
            if tick % DECIDE_TICKS == 0 and self.lead.decide(tick):
                urgent = True
        over, certificate = self._is_over(), self.map.certificate
        done = over and certificate.complete
        gave_up = reason(certificate) if over and not done else ""
        outbox = self._outgoing(tick) if urgent or tick % self._every == 0 else ()
        telemetry: dict[str, float | bool] = {}
        if (len(self.map.facts), done) != self._reported:
            self._reported = len(self.map.facts), done
            telemetry = {"certificate_satisfied": done, **findings(self.map, self.membership)}
        return Command(outbox=outbox, done=done, gave_up=gave_up, telemetry=telemetry)

    def _is_over(self) -> bool:
        """Return whether all space that any robot in reach can drive to is covered.

        After a wreck was found, a robot has no place until it stood at an end again.
        """
        statuses, members = self.membership.roster.statuses, self.membership.view.members
        places = [statuses[node].at for node in members]
        if self.map.wrecks and None in places:
            return False
        return bool(members) and all(
            self.map.complete_from(None if place is None else self.map.end(place)) for place in places
        )

    def _outgoing(self, tick: int) -> tuple[Transmission, ...]:
        beacon = TeamBeacon(
            self._node,
            self.membership.outgoing(),
            (),
            self.lead.plans,
            tuple(self.membership.others()),
            self.map.facts.digest,
            len(self.map.facts),
            *self._exchange.outgoing(tick),
        )
        return (Transmission("uplink", write_beacon(beacon)),)
