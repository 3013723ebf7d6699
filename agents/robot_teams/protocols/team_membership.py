"""Membership of a team: views by epochs, division, merging, and succession of the lead.

Pure protocol: messages in, views out.

A robot holds one view. It takes over a later view that includes it. If the lead's later view does not include it, it is
alone. The lead divides the team by several views, and merges teams by one view that includes those it has met. It drops
members that are silent or have taken another view. When the lead is silent, the member with the smallest id that is not
silent takes its place. Any message may be lost, late or copied: a view is only replaced by a later one. Robots without
a common view are separate teams, which merge when they meet. A wrong suspicion therefore costs only time: facts are
never withdrawn.
"""

from collections.abc import Sequence
from typing import Final

from zwerm.agents.robot_teams.protocols.team_messages import Status, TeamBeacon, View

# Time that the lead repeats views that it made for others, and time that a meeting is remembered [s].
REPEAT_S: Final = 10.0
MEETING_S: Final = 60.0
# Time that a member may show a later view of its own before it is dropped [s].
LEFT_S: Final = 2.0
# Time after a division in which its robots do not meet [s].
PARTED_S: Final = 20.0


def later(view: View, than: View) -> bool:
    """Return whether a view replaces another: by epoch, then the smaller lead, then more members."""
    return (view.epoch, -view.lead, len(view.members), view.members) > (
        *(than.epoch, -than.lead, len(than.members)),
        than.members,
    )


class Roster:
    """The newest status of every robot, and when it was news."""

    def __init__(self) -> None:
        self.statuses: dict[int, Status] = {}
        self.news_tick: dict[int, int] = {}

    def receive(self, status: Status, tick: int) -> None:
        """Take a status if it is newer."""
        known = self.statuses.get(status.node)
        if known is None or status.beat > known.beat:
            self.statuses[status.node] = status
            self.news_tick[status.node] = tick

    def silent_ticks(self, node: int, tick: int) -> int:
        """Return the number of ticks since the last news of a robot."""
        return tick - self.news_tick.setdefault(node, tick)


class TeamMembership:
    """One robot's view of its team."""

    def __init__(self, node: int, dt_s: float, silence_s: float) -> None:
        self.node = node
        self.view = View(1, node, (node,))
        self.roster = Roster()
        self.divisions = 0
        self.merges = 0
        self._silence_ticks = round(silence_s / dt_s)
        self._left_ticks = round(LEFT_S / dt_s)
        self._repeat_ticks = round(REPEAT_S / dt_s)
        self._meeting_ticks = round(MEETING_S / dt_s)
        self._parted_ticks = round(PARTED_S / dt_s)
        self._parted: dict[int, int] = {}
        self._latest_epoch = 1
        self._made: dict[View, int] = {}
        self._met: dict[int, tuple[View, int]] = {}

    @property
    def leads(self) -> bool:
        """True if this robot decides for the team."""
        return self.view.lead == self.node

    def receive(self, beacon: TeamBeacon, tick: int, near: bool) -> None:
        """Receive a beacon; `near` is true if its sender is close enough to be met."""
        self._receive_statuses(beacon, tick)
        theirs = beacon.views[0]
        for view in beacon.views:
            self._latest_epoch = max(self._latest_epoch, view.epoch)
            if self.node in view.members and later(view, self.view):
                self._adopt(view, tick)
        own = self.view
        if beacon.sender == own.lead and self.node not in theirs.members and later(theirs, own):
            self._adopt(View(self._latest_epoch + 1, self.node, (self.node,)), tick)
        if beacon.sender in self.view.members:
            for view in beacon.met:
                self._meet(view, tick)
        elif near and tick - self._parted.get(beacon.sender, -self._parted_ticks) >= self._parted_ticks:
            self._meet(theirs, tick)
        elif theirs.lead in self._met:
            self._met[theirs.lead] = theirs, self._met[theirs.lead][1]

    def accepts(self, sender: int) -> bool:
        """Return whether facts and plans of a sender are taken over: those of teammates are."""
        return sender in self.view.members

    def meet_first(self, tick: int) -> None:
        """Found the first team: the robot with the smallest id of all that receive each other at the start leads it."""
        received = sorted(self.roster.statuses.keys() | {self.node})
        if received[0] == self.node and len(received) > 1 and self.view.epoch == 1:
            self._adopt(View(2, self.node, tuple(received)), tick)

    def poll(self, tick: int) -> None:
        """Drop silent members, or take the place of a silent lead."""
        own = self.view
        for view in [view for view, until in self._made.items() if until < tick]:
            del self._made[view]
        for lead in [lead for lead, (_, since) in self._met.items() if tick - since > self._meeting_ticks]:
            del self._met[lead]
        if len(own.members) == 1:
            return
        gone = [node for node in own.members if node != self.node and self._is_gone(node, tick)]
        if not gone:
            return
        here = tuple([node for node in own.members if node not in gone])
        if self.leads or (own.lead in gone and here[0] == self.node):
            self._adopt(View(self._latest_epoch + 1, self.node, here), tick)

    def met(self) -> tuple[View, ...]:
        """Return the views of the teams that were met, by their leads."""
        return tuple([self._met[lead][0] for lead in sorted(self._met)])

    def others(self) -> list[Status]:
        """Return the newest statuses of the other members, to be passed on."""
        statuses = self.roster.statuses
        return [statuses[node] for node in self.view.members if node != self.node and node in statuses]

    def outgoing(self) -> tuple[View, ...]:
        """Return the views to broadcast: the own one first."""
        return (self.view, *self._made)

    def divide(self, groups: Sequence[tuple[int, ...]], tick: int) -> None:
        """Split the team: the lead's own group is one of `groups`, which are disjoint and together the team."""
        epoch = self._latest_epoch + 1
        for group in groups:
            lead = self.node if self.node in group else min(group)
            view = View(epoch, lead, tuple(sorted(group)))
            if self.node in group:
                own = view
            else:
                self._made[view] = tick + self._repeat_ticks
        self.divisions += 1
        self._adopt(own, tick)

    def merge(self, tick: int) -> bool:
        """Unite with the teams that were met and whose leads have larger ids; return whether there are any."""
        others = [view for view in self.met() if view.lead > self.node]
        if not others:
            return False
        members = {node for view in others for node in view.members} | {*self.view.members}
        self.merges += 1
        self._adopt(View(self._latest_epoch + 1, self.node, tuple(sorted(members))), tick)
        return True

    def merges_soon(self, tick: int, wait_ticks: int) -> bool:
        """Return whether a team was met a short time ago: the lead with the smaller id unites the two when all are free."""
        return any(tick - since < wait_ticks for _, since in self._met.values())

    def _receive_statuses(self, beacon: TeamBeacon, tick: int) -> None:
        for status in beacon.statuses:
            if status.node != self.node:
                self.roster.receive(status, tick)

    def _meet(self, view: View, tick: int) -> None:
        if self.node in view.members or view.lead in self.view.members:
            return
        known = self._met.get(view.lead)
        if known is None or tick - known[1] > self._meeting_ticks:
            self._met[view.lead] = view, tick
        elif later(view, known[0]):
            self._met[view.lead] = view, known[1]

    def _is_gone(self, node: int, tick: int) -> bool:
        """Return whether a member is silent, or keeps another view for longer than this one takes to reach it."""
        if self.roster.silent_ticks(node, tick) > self._silence_ticks:
            return True
        status, own = self.roster.statuses.get(node), self.view
        if status is None or status.team == (own.epoch, own.lead):
            return False
        limit = self._left_ticks if status.team[0] > own.epoch else self._silence_ticks
        return tick - self._since > limit

    _since = 0

    def _adopt(self, view: View, tick: int) -> None:
        self._latest_epoch = max(self._latest_epoch, view.epoch)
        for node in self.view.members:
            if node not in view.members:
                self._parted[node] = tick
        self.view = view
        self._since = tick
        for node in view.members:
            self.roster.news_tick[node] = max(self.roster.news_tick.get(node, tick), tick)
        for lead, (met, _) in list(self._met.items()):
            if lead in view.members or self.node in met.members:
                del self._met[lead]
