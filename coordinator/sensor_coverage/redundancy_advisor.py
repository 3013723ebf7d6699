"""The coordinator of decentralised robots: it finds redundant robots, and nothing else.

Robots report their parts of the complex (`messages.advice`). After a pause without new reports the advisor composes the
complex. It finds the robots that a relative 2-cycle through the fence does not use (`relative_homology`), and advises
some of them. No two of these see each other, and each leaves b0 and b1 as they are. The advisor has no slots, directions
and pushes. It moves no robot, and decides nothing without the neighbours' agreement.

All its knowledge is reported again and again: its messages are repeated, and it asks robots that another robot sees and
that have not reported. So an advisor that starts again needs no memory.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, Protocol

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.messages.advice import (
    CHANNEL,
    AdviceMessage,
    CollectReports,
    RedundantAdvice,
    ReportNoted,
    StandingReport,
    read,
    write,
)
from zwerm.coordinator.sensor_coverage.relative_homology import RelativeHomology
from zwerm.maths.simplicial import Edge, FlagComplex, edge, may_leave
from zwerm.wire.messages import Command, Observation, Transmission, Wake

# Ticks without a new report before the complex is examined.
QUIET_TICKS: Final = 5
# Ticks before advice is repeated, before a robot without a report is asked, and at most between repetitions.
REPEAT_TICKS: Final = 10
ASK_TICKS: Final = 30
REPEAT_TICKS_MAX: Final = 240


class AdvisorSetup(Protocol):
    """The parts of its setup that the advisor uses."""

    @property
    def dt_s(self) -> float:
        """The period of a tick [s]."""

    @property
    def bases(self) -> tuple[int, ...]:
        """The ids of the base stations."""


class _Repetition:
    """A message that is repeated less and less often."""

    def __init__(self, message: AdviceMessage, due: int, wait_ticks: int) -> None:
        self.message, self.due, self.wait_ticks = message, due, wait_ticks

    def repeat(self, tick: int) -> bool:
        """Return whether the message is due, and schedule the next repetition."""
        if tick < self.due:
            return False
        self.due = tick + self.wait_ticks
        self.wait_ticks = min(2 * self.wait_ticks, REPEAT_TICKS_MAX)
        return True


class RedundancyAdvisor:
    """Advises redundant robots to leave the complex, by relative homology."""

    Parameters = PlannerParameters

    def __init__(self, setup: AdvisorSetup) -> None:
        self._dt_s = setup.dt_s
        self._bases = setup.bases
        self._redundancy = RelativeHomology()
        self._reports: dict[int, StandingReport] = {}
        self._examine_at: int | None = None
        self._questions: dict[int, _Repetition] = {}
        self._advice: dict[int, _Repetition] = {}
        self._started = False

    def step(self, observation: Observation) -> Command:
        """Take in reports, and advise redundant robots."""
        tick = observation.tick
        telemetry: dict[str, float | bool] = {}
        outbox = [] if self._started else [_packet(CollectReports(), None)]
        self._started = True
        for packet in observation.inbox:
            message = read(packet.payload)
            if isinstance(message, StandingReport) and packet.sender is not None:
                outbox += self._take(packet.sender, message, tick)
        if self._examine_at is not None and tick >= self._examine_at:
            self._examine_at = None
            telemetry = {"redundant_robots": self._examine(tick)}
        self._find_unheard(tick)
        for repeated in (self._questions, self._advice):
            outbox += [_packet(each.message, node) for node, each in repeated.items() if each.repeat(tick)]
        return Command(outbox=tuple(outbox), wake=Wake(at_s=self._next_wake_s(), on_packet=True), telemetry=telemetry)

    # --- reports ----------------------------------------------------------------------------------------------------

    def _take(self, node: int, report: StandingReport, tick: int) -> Iterator[Transmission]:
        known = self._reports.get(node)
        if known is None or report.number > known.number:
            self._reports[node] = report
            self._examine_at = tick + QUIET_TICKS
            self._advice.pop(node, None)
        if known is None or report.number >= known.number:
            yield _packet(ReportNoted(report.number), node)

    def _find_unheard(self, tick: int) -> None:
        """Ask stations and visible robots that have not reported."""
        seen = {*self._bases, *(node for each in self._reports.values() for node in each.listed)}
        self._questions = {
            node: self._questions.get(node) or _Repetition(CollectReports(), tick + ASK_TICKS, ASK_TICKS)
            for node in sorted(seen - self._reports.keys())
        }

    # --- redundant robots -------------------------------------------------------------------------------------------

    def _examine(self, tick: int) -> int:
        """Find the robots to advise, and return the number of redundant robots."""
        standing = {node: each for node, each in sorted(self._reports.items()) if each.stands}
        complex_ = FlagComplex({node: each.listed for node, each in standing.items()})
        boundary_edges = [edge(node, other) for node, each in standing.items() for other in each.fenced]
        kept = tuple(node for node, each in standing.items() if node in self._bases or not each.willing)
        redundant = self._redundancy.redundant(ScanResult({}, complex_, kept), _within(boundary_edges, complex_))
        self._advice = {
            node: _Repetition(
                RedundantAdvice(tuple((other, standing[other].version) for other in complex_.neighbours[node])),
                tick,
                REPEAT_TICKS,
            )
            for node in _independent(redundant, complex_, standing)
        }
        return len(redundant)

    def _next_wake_s(self) -> float | None:
        times = [each.due for each in (*self._questions.values(), *self._advice.values())]
        times += [self._examine_at] if self._examine_at is not None else []
        return min(times) * self._dt_s if times else None


def _independent(redundant: Iterable[int], complex_: FlagComplex, standing: Mapping[int, StandingReport]) -> list[int]:
    """Return redundant robots that may leave in any order, or together, without a change of b0 or b1.

    A robot that is redundant after other departures may be needed before them. A robot that sees none of the departing
    robots keeps its neighbours and the edges among them, and so the criterion. A robot that sees a robot outside the
    complex waits.
    """
    chosen: dict[int, None] = {}
    for node in redundant:
        around = complex_.neighbours[node]
        if around != standing[node].listed or any(other in chosen for other in around):
            continue
        if may_leave(node, complex_.neighbours):
            chosen[node] = None
    return list(chosen)


def _within(edges: Iterable[Edge], complex_: FlagComplex) -> tuple[Edge, ...]:
    return tuple(dict.fromkeys(each for each in edges if each in complex_))


def _packet(message: AdviceMessage, to: int | None) -> Transmission:
    return Transmission(CHANNEL, write(message), to)
