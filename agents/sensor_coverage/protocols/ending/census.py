"""A census by which the base station detects the end of the deployment, over links between neighbours.

A wave starts at the base. Each robot joins it with the first message of it; the sender of that message is its parent. A
robot counts once all its neighbours have joined and its children have counted. It counts robots, frontier claims, and
the latest wave in which any of them was disturbed. This is propagation of information with feedback (Segall 1983). A
robot is disturbed when it claims a frontier, is busy, or sees neighbours come or go. A robot that lacks an answer asks
again, so a lost message costs only time.

The base concludes after two waves without claims, under two conditions. Both waves counted the same robots in the same
incarnations, and no robot was disturbed since the first. Then all robots were quiet at some moment between the two
waves. A message in flight between two robots must keep one of them busy. So a conclusion is wrong only in two cases. In
the first, a robot was no neighbour of any counted robot. In the second, robots lost their memory in both waves, and
late messages of their earlier incarnations were accepted.

What a dead robot saw of walls counts no more, and only robots around it know that it is dead. So a wave says who was dead
by the tally before, and the base concludes only after a second wave that says so.

A conclusion gives no information about robots that no wave reached. So tallies name the counted robots, and the robots
that one of these declares dead. It sees the body, and its requests had no answer for longer than any living robot is
silent. A released robot that is neither counted nor dead is `missing`. Waves and tallies carry the roster of all
released robots. So a base that lost its memory learns the roster from any of them.
"""

from collections.abc import Iterable
from typing import Final

from zwerm.agents.sensor_coverage.messages.robot_sets import from_bytes, members, robot_set, to_bytes
from zwerm.agents.sensor_coverage.messages.waves import CensusMessage, CensusTally, CensusWave
from zwerm.agents.sensor_coverage.protocols.component import Outgoing

# Wave numbers are never below the base's clock in these units, so that a base that lost its memory repeats none.
TICKS_PER_S: Final = 1_000
# The permitted duration of a wave doubles after each wave that took too long, at most this many times.
DOUBLINGS_MAX: Final = 6
# Sums of incarnation numbers are taken modulo this.
INCARNATIONS: Final = 2**62


class Census:
    """One robot's part, or that of the base if `base`.

    In every tick `update` comes first, then `receive` for each message, then `poll`. A robot that lacks an answer asks
    every `poll_s`. A wave begins every `every_s`. If the wave before has not come back, the interval doubles each time.
    `now_s` is the robot's own clock; that of the base must not be set back, not even by a restart. `incarnation` is a
    random number, another one after each loss of memory. `search` counts the times that all robots
    were to try again what had failed; the base increases it.
    """

    def __init__(self, me: int, poll_s: float, every_s: float, incarnation: int, base: bool = False) -> None:
        self.search = 0
        self._me = me
        self._incarnation = incarnation
        self._poll_s = poll_s
        self._every_s = every_s
        self._base = base
        self._listed: tuple[int, ...] = ()
        self._claims = 0
        self._unproven = 0
        self._dead = 0
        self._roster = 0
        self._wave_roster = 0  # as the wave brought it
        self._wave_dead = 0  # the same, and that of the wave before
        self._dead_before = 0
        self._number = 0
        self._parent: int | None = None
        self._joined: dict[int, None] = {}  # neighbours that have joined by another parent
        self._tallies: dict[int, CensusTally] = {}  # of children
        self._counted: CensusTally | None = None
        self._disturbed = 0
        self._poll_at_s = 0.0
        self._begun_s = 0.0
        self._doublings = 0
        self._last: CensusTally | None = None
        self._concluded = False

    @property
    def concluded(self) -> bool:
        """True if the base has concluded that all was quiet, and was not disturbed since."""
        return self._concluded

    @property
    def waits(self) -> bool:
        """True if the robot has joined a wave and lacks an answer."""
        return self._number > 0 and self._counted is None

    @property
    def last(self) -> CensusTally | None:
        """The tally of the latest wave that came back to the base."""
        return self._last

    @property
    def number(self) -> int:
        """The number of the latest wave that the robot has joined."""
        return self._number

    @property
    def told_dead(self) -> tuple[int, ...]:
        """The robots that this wave says are dead, ascending."""
        return members(self._wave_dead)

    @property
    def missing(self) -> tuple[int, ...]:
        """The robots that were let out, and that the latest tally has neither as present nor as dead, ascending."""
        last = self._last
        found = 0 if last is None else from_bytes(last.present) | from_bytes(last.dead)
        return members(self._roster & ~(found | robot_set([self._me])))

    def let_out(self, robots: Iterable[int]) -> None:
        """Add robots to the roster."""
        self._roster |= robot_set(robots)

    def restarted(self, node: int) -> None:
        """Forget the answers of a neighbour's former incarnation; a moment without it was not quiet."""
        self._joined.pop(node, None)
        self._tallies.pop(node, None)
        self._disturbed = self._number
        self._concluded = False

    def update(
        self, neighbours: Iterable[int], claims: int, busy: bool, dead: Iterable[int] = (), unproven: int = 0
    ) -> None:
        """Take in the visible robots, the number of frontier claims, and whether the robot moves or waits for an answer.

        `dead` are visible robots that are declared dead; they are no neighbours. `unproven` counts the open arcs around
        this robot that no attempt has closed.
        """
        self._unproven = unproven
        self._dead = robot_set(dead)
        listed = tuple(sorted(neighbours))
        if listed != self._listed or claims or busy:
            self._disturbed = self._number
            self._concluded = False
        self._listed, self._claims = listed, claims

    def receive(self, sender: int, message: CensusMessage, now_s: float) -> list[Outgoing]:
        """Take in a message from another robot, and return the answers."""
        match message:
            case CensusWave():
                return self._receive_wave(sender, message, now_s)
            case CensusTally() if message.number == self._number and self._counted is None:
                self._tallies[sender] = message
                return self._count()
        return []

    def poll(self, now_s: float) -> list[Outgoing]:
        """Ask neighbours again that have not answered; at the base, begin another wave when it is due."""
        if self._base and (self._number == 0 or now_s >= self._begun_s + self._every_s * 2.0**self._doublings):
            self._begun_s = now_s
            # Set back to zero when a wave comes back.
            self._doublings = min(self._doublings + 1, DOUBLINGS_MAX)
            self._wave_roster = self._roster
            self._dead_before, self._wave_dead = (
                self._wave_dead,
                0 if self._last is None else from_bytes(self._last.dead),
            )
            return self._join(max(self._number + 1, int(now_s * TICKS_PER_S)), None, now_s)
        if self._number == 0 or self._counted is not None or now_s < self._poll_at_s:
            return []
        if not self._missing():  # the missing robots are no longer neighbours
            return self._count()
        return self._ask(again=True, now_s=now_s)

    def _receive_wave(self, sender: int, wave: CensusWave, now_s: float) -> list[Outgoing]:
        mine = wave.parent == self._me
        if wave.number > self._number and self._me in wave.missing and not mine and not self._base:
            self.search = max(self.search, wave.search)
            self._wave_roster = from_bytes(wave.roster)
            self._roster |= self._wave_roster
            self._wave_dead = from_bytes(wave.dead)
            return self._join(wave.number, sender, now_s)
        if wave.number != self._number:
            return []
        sent: list[Outgoing] = []
        if not mine and self._counted is None:
            self._joined[sender] = None
            sent = self._count()
        if wave.again and self._me in wave.missing:
            if sender != self._parent:
                sent.append(Outgoing(sender, self._wave((), again=False)))
            elif self._counted is not None and not sent:
                sent.append(Outgoing(sender, self._counted))
        return sent

    def _join(self, number: int, parent: int | None, now_s: float) -> list[Outgoing]:
        self._number, self._parent = number, parent
        self._joined = {} if parent is None else {parent: None}
        self._tallies = {}
        self._counted = None
        return [*self._ask(again=False, now_s=now_s), *self._count()]

    def _ask(self, again: bool, now_s: float) -> list[Outgoing]:
        self._poll_at_s = now_s + self._poll_s
        return [Outgoing(None, self._wave(self._missing(), again))]

    def _wave(self, missing: tuple[int, ...], again: bool) -> CensusWave:
        roster, dead = to_bytes(self._roster), to_bytes(self._wave_dead)
        return CensusWave(self._number, self._parent, missing, again, roster, self.search, dead)

    def _missing(self) -> tuple[int, ...]:
        return tuple(node for node in self._listed if node not in self._joined and node not in self._tallies)

    def _count(self) -> list[Outgoing]:
        """Count if all neighbours have answered: send the tally to the parent, or conclude at the base."""
        if self._missing():
            return []
        tallies = list(self._tallies.values())
        present, dead = robot_set([self._me]), self._dead
        for each in tallies:
            present |= from_bytes(each.present)
            dead |= from_bytes(each.dead)
            self._roster |= from_bytes(each.roster)
        counted = CensusTally(
            self._number,
            1 + sum(each.robots for each in tallies),
            self._claims + sum(each.claims for each in tallies),
            max([self._disturbed, *(each.disturbed for each in tallies)]),
            (self._incarnation + sum(each.incarnations for each in tallies)) % INCARNATIONS,
            to_bytes(present),
            to_bytes(dead),
            b"" if self._roster == self._wave_roster else to_bytes(self._roster),
            self._unproven + sum(each.unproven for each in tallies),
        )
        self._counted = counted
        if self._parent is not None:
            return [Outgoing(self._parent, counted)]
        self._doublings = 0
        before, self._last = self._last, counted
        self._concluded = (
            before is not None
            and before.claims == counted.claims == 0
            and before.incarnations == counted.incarnations
            and counted.disturbed < before.number
            and not dead & ~self._dead_before
        )
        return []
