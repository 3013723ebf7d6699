"""What a deployment needs to have decided, one interface for each decision.

Behind each stands a central piece (Dijkstra, relative H2, ...) or one that robots agree on among themselves; who composes
them does not know which. All speak of places, and none of them moves anybody.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

from zwerm.agents.sensor_coverage.frontier.fence import Views
from zwerm.agents.sensor_coverage.frontier.paths import Reach
from zwerm.maths.simplicial import Edge, FlagComplex


class ScanResult(NamedTuple):
    """What a survey found: who sees whom and where, and the places of base stations."""

    views: Views
    complex_: FlagComplex
    bases: tuple[int, ...]


class Plan(NamedTuple):
    """One deployment: the robot at `mover` goes along `direction`, and the robots on the path follow.

    `key` is what is expanded, an edge's side or a robot's gap; `anchors` are the places that tell the new robot's distance.
    The path leads from a source to the mover, once there is one.
    """

    key: tuple[int, ...]
    mover: int
    direction: float
    hop_m: float
    clear_m: float
    anchors: tuple[int, ...]
    path: tuple[int, ...] = ()


# Sources of robots (place: cost to start there) to the cheapest ways from them.
Ways = Callable[[FlagComplex, Mapping[int, float]], Reach]


class FrontierService(Protocol):
    """Where could the swarm go on? It remembers what was tried, and failed."""

    @property
    def frontier(self) -> tuple[Edge, ...]:
        """The edges that can be expanded, as of the last look."""

    @property
    def obstacle(self) -> tuple[Edge, ...]:
        """The edges beside obstacles, as of the last look."""

    def look(self, picture: ScanResult) -> None:
        """Take what the places see now."""

    def plans(self) -> Iterable[Sequence[Plan]]:
        """Yield the deployments there could be: first those wanted most, and others for when none of these can be reached."""

    def rim(self) -> tuple[Edge, ...]:
        """Return edges with a closed chain among them around all that is uncovered."""

    def note_attempt(self, plan: Plan) -> None:
        """Take note that a plan is being tried."""

    def note_failure(self, plan: Plan, driven_m: float) -> None:
        """Take note that a wall was in the way after so far."""


class PathService(Protocol):
    """By which way do robots come?"""

    def ways(
        self,
        complex_: FlagComplex,
        sources: Mapping[int, float],
        obstacle: Collection[Edge],
        shut: Collection[int] = (),
    ) -> Reach:
        """Return the cheapest ways from `sources` (place: cost to start there); obstacle edges are dear.

        Ways may begin at places that are `shut`, but none leads there.
        """


class RedundancyService(Protocol):
    """Who can be spared?"""

    def redundant(self, picture: ScanResult, rim: Collection[Edge]) -> tuple[int, ...]:
        """Return places that can all be left at once and leave nothing uncovered."""


class AssignmentService(Protocol):
    """Which of the deployments that there could be come next?"""

    def assign(
        self, plans: Iterable[Sequence[Plan]], picture: ScanResult, sources: Mapping[int, float], ways: Ways
    ) -> tuple[Plan, ...]:
        """Return the plans to carry out at once, with their paths; none if no path leads to any."""


class TerminationService(Protocol):
    """Is it over?"""

    def judge(self, assigned: bool, frontier: bool) -> str:
        """Return the outcome, or nothing while it goes on.

        `assigned`: there is something to do; `frontier`: there is something left to expand.
        """


class Services(NamedTuple):
    """One of each."""

    frontier: FrontierService
    paths: PathService
    redundancy: RedundancyService
    assignment: AssignmentService
    termination: TerminationService
