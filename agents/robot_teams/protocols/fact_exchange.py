"""Sharing facts within a team: new ones in every beacon for a while, all of them where a teammate's set stays different."""

from typing import Final

from zwerm.agents.robot_teams.mapping.facts import Fact, FrontierCut, Return, SweptSegment, TracedArc, Void
from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.protocols.team_messages import TeamBeacon

# Times [s]: a new fact is in every beacon; sets may differ before all facts are sent; between two such sendings.
NEW_S: Final = 1.5
DIFFERENT_S: Final = 1.0
ALL_EVERY_S: Final = 1.0
# Largest number of facts in one message: an arc takes about 40 bytes.
FACTS_MAX: Final = 800


# Facts by kind, as a beacon carries them.
Parcel = tuple[
    tuple[SweptSegment, ...], tuple[TracedArc, ...], tuple[Void, ...], tuple[Return, ...], tuple[FrontierCut, ...]
]


class FactExchange:
    """Anti-entropy for one robot's map."""

    def __init__(self, slice_map: SliceMap, dt_s: float) -> None:
        self._map = slice_map
        self._new_ticks = round(NEW_S / dt_s)
        self._different_ticks = round(DIFFERENT_S / dt_s)
        self._all_every_ticks = round(ALL_EVERY_S / dt_s)
        self._counts: list[tuple[int, int]] = []  # the tick at which the set first had this number of facts
        self._differs_since: dict[int, int] = {}
        self._all_tick = -self._all_every_ticks
        self._page = 0

    def receive(self, beacon: TeamBeacon, tick: int) -> None:
        """Take over the facts of a beacon, and note whether its sender lacks some of ours."""
        self._map.merge((*beacon.segments, *beacon.arcs, *beacon.voids, *beacon.returns, *beacon.cuts))
        if beacon.digest == self._map.facts.digest:
            self._differs_since.pop(beacon.sender, None)
        else:
            self._differs_since.setdefault(beacon.sender, tick)

    def forget(self, node: int) -> None:
        """End the exchange with a robot."""
        self._differs_since.pop(node, None)

    def outgoing(self, tick: int) -> Parcel:
        """Return the facts to send now."""
        facts = self._map.facts
        if not self._counts or self._counts[-1][1] != len(facts):
            self._counts.append((tick, len(facts)))
        while len(self._counts) > 1 and self._counts[1][0] <= tick - self._new_ticks:
            self._counts.pop(0)
        # Everything that came after the newest count that is old enough.
        old = self._counts[0][1] if self._counts[0][0] <= tick - self._new_ticks else 0
        send = facts.since(old)
        pending = any(tick - since >= self._different_ticks for since in self._differs_since.values())
        if pending and tick - self._all_tick >= self._all_every_ticks:
            self._all_tick = tick
            send = facts.since(0)
            if len(send) > FACTS_MAX:
                pages = -(-len(send) // FACTS_MAX)
                self._page = (self._page + 1) % pages
                send = send[self._page * FACTS_MAX : (self._page + 1) * FACTS_MAX]
        send = send[-FACTS_MAX:]
        return _sorted_out(send)


def _sorted_out(facts: list[Fact]) -> Parcel:
    return (
        tuple([fact for fact in facts if isinstance(fact, SweptSegment)]),
        tuple([fact for fact in facts if isinstance(fact, TracedArc)]),
        tuple([fact for fact in facts if isinstance(fact, Void)]),
        tuple([fact for fact in facts if isinstance(fact, Return)]),
        tuple([fact for fact in facts if isinstance(fact, FrontierCut)]),
    )
