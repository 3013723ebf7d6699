"""Is it over? A census that the base station takes by itself, over links between neighbours, again and again.

A wave goes out from the base; every robot joins it on hearing of it first, and that neighbour is its parent. Once all its
neighbours have joined, and its children have counted, it counts too: robots, claims to a frontier, and the latest wave in which
any of them was stirred, that is claimed a frontier, was busy, or saw neighbours come or go (propagation of information with
feedback, Segall 1983). Who lacks an answer asks again, so a lost message costs time.

The base concludes after two waves that nobody claimed anything in, that the same robots counted in, and the same lives of
them, and since the first of which nobody was stirred: between the two there was a moment at which all were quiet. What is in
flight between two robots has to keep one of them busy. So a conclusion is wrong only if a robot was no neighbour of anybody
who was counted, or if robots lost their memory in both waves and late messages of their former lives were believed.
"""

from collections.abc import Iterable
from typing import Annotated, Final, NamedTuple

from msgspec import Meta, Struct

Count = Annotated[int, Meta(ge=0, le=2**62)]

# Waves are numbered by the base's clock in these units at least, so that one that lost its memory repeats no number.
TICKS_PER_S: Final = 1_000
# How much longer a wave may take after so many that took too long: this many doublings at most.
DOUBLINGS_MAX: Final = 6
# Sums of lives are taken modulo this.
LIVES: Final = 2**62


class CensusWave(Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag="wave"):
    """The sender has joined this wave, by `parent` (None: it is the base), and waits for the neighbours in `missing`.

    `again`: it has waited for so long that those which have joined shall say so once more.
    """

    number: Count
    parent: Count | None
    missing: tuple[Count, ...]
    again: bool


class CensusTally(Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag="tally"):
    """To the parent: how many robots counted, what they claim, and the latest wave in which one of them was stirred.

    `lives` is the sum of their lives' numbers.
    """

    number: Count
    robots: Count
    claims: Count
    stirred: Count
    lives: Count


Message = CensusWave | CensusTally


class CensusMessage(NamedTuple):
    """A message to one robot, or to all that hear it."""

    to: int | None
    message: Message


class Census:
    """One robot's part; that of the base, if `base`.

    `note` comes first in every tick, then `hear` for what was heard, then `tick`. Who lacks an answer asks every `poll_s`; a
    wave begins every `every_s`, or if the one before has not come back, after twice that, and longer every time. `now_s` is
    the robot's own clock; that of the base must not be set back, not even by a restart. `life` is a number drawn at random:
    another one if the robot loses its memory.
    """

    def __init__(self, me: int, poll_s: float, every_s: float, life: int, base: bool = False) -> None:
        self._me = me
        self._life = life
        self._poll_s = poll_s
        self._every_s = every_s
        self._base = base
        self._listed: tuple[int, ...] = ()
        self._claims = 0
        self._number = 0
        self._parent: int | None = None
        self._joined: dict[int, None] = {}  # neighbours that have joined by somebody else
        self._tallies: dict[int, CensusTally] = {}  # of children
        self._told: CensusTally | None = None
        self._stirred = 0
        self._poll_at_s = 0.0
        self._begun_s = 0.0
        self._doublings = 0
        self._last: CensusTally | None = None
        self._concluded = False

    @property
    def concluded(self) -> bool:
        """Whether the base knows that all was quiet, and has heard of nothing since."""
        return self._concluded

    @property
    def waits(self) -> bool:
        """Whether the robot has joined a wave and lacks an answer."""
        return self._number > 0 and self._told is None

    @property
    def last(self) -> CensusTally | None:
        """What the latest wave that came back to the base has counted."""
        return self._last

    def note(self, neighbours: Iterable[int], claims: int, busy: bool) -> None:
        """Take in whom the robot sees, how many frontiers it claims, and whether it moves or waits for an answer."""
        listed = tuple(sorted(neighbours))
        if listed != self._listed or claims or busy:
            self._stirred = self._number
            self._concluded = False
        self._listed, self._claims = listed, claims

    def hear(self, sender: int, message: Message, now_s: float) -> list[CensusMessage]:
        """Take in a message from another robot, and return what to answer."""
        match message:
            case CensusWave():
                return self._hear_wave(sender, message, now_s)
            case CensusTally() if message.number == self._number and self._told is None:
                self._tallies[sender] = message
                return self._count()
        return []

    def tick(self, now_s: float) -> list[CensusMessage]:
        """Ask those again that have not answered; at the base, begin another wave when it is time."""
        if self._base and (self._number == 0 or now_s >= self._begun_s + self._every_s * 2.0**self._doublings):
            self._begun_s = now_s
            # Counted back to none when a wave returns.
            self._doublings = min(self._doublings + 1, DOUBLINGS_MAX)
            return self._join(max(self._number + 1, int(now_s * TICKS_PER_S)), None, now_s)
        if self._number == 0 or self._told is not None or now_s < self._poll_at_s:
            return []
        if not self._missing():  # those who were missing are no neighbours any more
            return self._count()
        return self._ask(again=True, now_s=now_s)

    def _hear_wave(self, sender: int, wave: CensusWave, now_s: float) -> list[CensusMessage]:
        mine = wave.parent == self._me
        if wave.number > self._number and self._me in wave.missing and not mine and not self._base:
            return self._join(wave.number, sender, now_s)
        if wave.number != self._number:
            return []
        sent: list[CensusMessage] = []
        if not mine and self._told is None:
            self._joined[sender] = None
            sent = self._count()
        if wave.again and self._me in wave.missing:
            if sender != self._parent:
                sent.append(CensusMessage(sender, CensusWave(self._number, self._parent, (), False)))
            elif self._told is not None and not sent:
                sent.append(CensusMessage(sender, self._told))
        return sent

    def _join(self, number: int, parent: int | None, now_s: float) -> list[CensusMessage]:
        self._number, self._parent = number, parent
        self._joined = {} if parent is None else {parent: None}
        self._tallies = {}
        self._told = None
        return [*self._ask(again=False, now_s=now_s), *self._count()]

    def _ask(self, again: bool, now_s: float) -> list[CensusMessage]:
        self._poll_at_s = now_s + self._poll_s
        return [CensusMessage(None, CensusWave(self._number, self._parent, self._missing(), again))]

    def _missing(self) -> tuple[int, ...]:
        return tuple(node for node in self._listed if node not in self._joined and node not in self._tallies)

    def _count(self) -> list[CensusMessage]:
        """Count, if all neighbours have answered."""
        if self._missing():
            return []
        tallies = list(self._tallies.values())
        told = CensusTally(
            self._number,
            1 + sum(each.robots for each in tallies),
            self._claims + sum(each.claims for each in tallies),
            max([self._stirred, *(each.stirred for each in tallies)]),
            (self._life + sum(each.lives for each in tallies)) % LIVES,
        )
        self._told = told
        if self._parent is not None:
            return [CensusMessage(self._parent, told)]
        self._doublings = 0
        before, self._last = self._last, told
        self._concluded = (
            before is not None
            and before.claims == told.claims == 0
            and before.lives == told.lives
            and told.stirred < before.number
        )
        return []
