"""The chain of a push as one of its robots sees it: its position, its neighbours in the chain, and the future occupants."""

from collections.abc import Iterable, Mapping

from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import Landmark
from zwerm.agents.sensor_coverage.messages.pushes import Chain, ReferenceBearing
from zwerm.agents.sensor_coverage.motion.push_geometry import SlotReference, future_occupants, landmarks_for_move


class PushChain:
    """The robots of a push, rear to front, each with its slot before the push; `me` is one of them."""

    def __init__(self, links: Chain, me: int) -> None:
        self.links = links
        self.me = me
        self.index = next(n for n, (_, node) in enumerate(links) if node == me)

    @property
    def is_rear(self) -> bool:
        """True if this robot is the last of the chain."""
        return self.index == 0

    @property
    def is_even(self) -> bool:
        """True for every second robot of the chain, the rear among them."""
        return self.index % 2 == 0

    @property
    def leads(self) -> bool:
        """True if this robot is the first of the chain."""
        return self.index == len(self.links) - 1

    @property
    def origin(self) -> int:
        """This robot's slot before the push."""
        return self.links[self.index][0]

    @property
    def leader(self) -> tuple[int, int]:
        """The slot of the leader before the push, and the leader."""
        return self.links[-1]

    @property
    def behind(self) -> int | None:
        """The robot behind this one, or None at the rear."""
        return None if self.is_rear else self.links[self.index - 1][1]

    @property
    def ahead(self) -> int | None:
        """The robot ahead of this one, or None for the leader."""
        return None if self.leads else self.links[self.index + 1][1]

    def future(self) -> dict[int, int]:
        """Return the next occupant of each slot that changes hands."""
        return future_occupants([slot for slot, _ in self.links], [node for _, node in self.links])

    def landmarks(
        self, references: Iterable[ReferenceBearing], future: Mapping[int, int], heading_rad: float, origin: int
    ) -> tuple[Landmark, ...]:
        """Return the landmarks of this robot's move from the slot `origin`, by the memory of the goal's slot."""
        rear = self.links[0][0]
        return landmarks_for_move(
            (SlotReference(each.slot, each.node, each.direction_rad) for each in references),
            future,
            self.me,
            heading_rad,
            vacated=() if rear in (0, NOWHERE) else (rear,),
            station=0 if origin == 0 else None,
        )
