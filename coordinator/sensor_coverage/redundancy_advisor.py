"""The coordinator where robots find frontier, path, fence and end by themselves: it finds who can be spared, and nothing else.

Robots report how they stand (`messages.advice`). After a pause without new reports the advisor makes a complex of them. It
finds the robots that a relative 2-cycle through the fence does without (`frontier.relative_homology`), and tells some of them:
no two that see each other, and each only if b0 and b1 stay the same when it leaves this complex. The advisor is told of no
place, no direction and no push. It moves no robot, and decides nothing that neighbours do not agree to.

Everything it knows it was told, and is told again: what it says is repeated, and whom somebody sees and nobody heard of is
asked. One that begins anew therefore needs to remember nothing.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from zwerm.agents.sensor_coverage.frontier.planner import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.relative_homology import RelativeHomology
from zwerm.agents.sensor_coverage.frontier.services import ScanResult
from zwerm.agents.sensor_coverage.messages.advice import (
    CHANNEL,
    CollectReports,
    RedundantAdvice,
    ReportNoted,
    StandingReport,
    Word,
    read,
    write,
)
from zwerm.coordinator.sensor_coverage.coordinator import CoordinatorSetup
from zwerm.maths.simplicial import Edge, FlagComplex, edge, may_leave
from zwerm.wire.messages import Command, Observation, Transmission, Wake

# How long nothing new has to come before it is looked at [ticks].
QUIET_TICKS: Final = 5
# How soon a verdict is said again, and somebody unheard of asked, first and at most [ticks]: a newborn speaks of itself.
AGAIN_TICKS: Final = 10
ASK_TICKS: Final = 30
AGAIN_TICKS_MAX: Final = 240


class _Repetition:
    """Something that is said again and again, less and less often."""

    def __init__(self, word: Word, due: int, wait_ticks: int) -> None:
        self.word, self.due, self.wait_ticks = word, due, wait_ticks

    def again(self, tick: int) -> bool:
        """Tell whether it is time to say it."""
        if tick < self.due:
            return False
        self.due = tick + self.wait_ticks
        self.wait_ticks = min(2 * self.wait_ticks, AGAIN_TICKS_MAX)
        return True


class RedundancyAdvisor:
    """Tells robots that find their way by themselves who of them can be spared, by relative homology."""

    Parameters = PlannerParameters

    def __init__(self, setup: CoordinatorSetup) -> None:
        self._dt_s = setup.dt_s
        self._bases = setup.bases
        self._redundancy = RelativeHomology()
        self._standing: dict[int, StandingReport] = {}
        self._look_at: int | None = None
        self._questions: dict[int, _Repetition] = {}
        self._verdicts: dict[int, _Repetition] = {}
        self._begun = False

    def step(self, observation: Observation) -> Command:
        """Take in what robots say, and tell those who can be spared."""
        tick, told = observation.tick, {}
        outbox = [] if self._begun else [_packet(CollectReports(), None)]
        self._begun = True
        for packet in observation.inbox:
            word = read(packet.payload)
            if isinstance(word, StandingReport) and packet.sender is not None:
                outbox += self._take(packet.sender, word, tick)
        if self._look_at is not None and tick >= self._look_at:
            self._look_at = None
            told = {"redundant_robots": self._look(tick)}
        self._find_unheard(tick)
        for said in (self._questions, self._verdicts):
            outbox += [_packet(each.word, node) for node, each in said.items() if each.again(tick)]
        return Command(outbox=tuple(outbox), wake=Wake(at_s=self._next_s(), on_packet=True), told=told)

    # --- what it hears ----------------------------------------------------------------------------------------------

    def _take(self, node: int, word: StandingReport, tick: int) -> Iterator[Transmission]:
        known = self._standing.get(node)
        if known is None or word.number > known.number:
            self._standing[node] = word
            self._look_at = tick + QUIET_TICKS
            self._verdicts.pop(node, None)
        if known is None or word.number >= known.number:
            yield _packet(ReportNoted(word.number), node)

    def _find_unheard(self, tick: int) -> None:
        """Ask those that stations or robots see, and that have not said anything."""
        seen = {*self._bases, *(node for each in self._standing.values() for node in each.listed)}
        self._questions = {
            node: self._questions.get(node) or _Repetition(CollectReports(), tick + ASK_TICKS, ASK_TICKS)
            for node in sorted(seen - self._standing.keys())
        }

    # --- who can be spared ------------------------------------------------------------------------------------------

    def _look(self, tick: int) -> int:
        """Find whom to tell that they can be spared, and return how many could be."""
        there = {node: each for node, each in sorted(self._standing.items()) if each.stands}
        complex_ = FlagComplex({node: each.listed for node, each in there.items()})
        rim = [edge(node, other) for node, each in there.items() for other in each.fenced]
        kept = tuple(node for node, each in there.items() if node in self._bases or not each.willing)
        redundant = self._redundancy.redundant(ScanResult({}, complex_, kept), _known(rim, complex_))
        self._verdicts = {
            node: _Repetition(
                RedundantAdvice(tuple((other, there[other].version) for other in complex_.neighbours[node])),
                tick,
                AGAIN_TICKS,
            )
            for node in _apart(redundant, complex_, there)
        }
        return len(redundant)

    # --- means ------------------------------------------------------------------------------------------------------

    def _next_s(self) -> float | None:
        times = [each.due for each in (*self._questions.values(), *self._verdicts.values())]
        times += [self._look_at] if self._look_at is not None else []
        return min(times) * self._dt_s if times else None


def _apart(redundant: Iterable[int], complex_: FlagComplex, there: Mapping[int, StandingReport]) -> list[int]:
    """Return who may leave now, in any order or at once, without a change of b0 or b1.

    What may be spared when others have left may not be before. Who sees none of the others that leave keeps the same neighbours
    with the same edges among them, and so the criterion. Whoever sees somebody that is not one of the complex has to wait.
    """
    chosen: dict[int, None] = {}
    for node in redundant:
        around = complex_.neighbours[node]
        if around != there[node].listed or any(other in chosen for other in around):
            continue
        if may_leave(node, complex_.neighbours):
            chosen[node] = None
    return list(chosen)


def _known(rim: Iterable[Edge], complex_: FlagComplex) -> tuple[Edge, ...]:
    return tuple(dict.fromkeys(each for each in rim if each in complex_))


def _packet(word: Word, to: int | None) -> Transmission:
    return Transmission(CHANNEL, write(word), to)
