"""Leaders of pushes whose paths cross drive at the same time, and wait for the robots behind them."""

from collections.abc import Sequence

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.frontier.attempt_log import AttemptLog
from zwerm.agents.sensor_coverage.frontier.paths import CheapestRoutes, Dijkstra
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import Arrived
from zwerm.coordinator.sensor_coverage.assignment import LEADERS_APART_EDGES, WAITING_MAX, CheapestFirst
from zwerm.coordinator.sensor_coverage.command_mailbox import Routine
from zwerm.coordinator.sensor_coverage.coordinator import SensorCoverageCoordinator
from zwerm.coordinator.sensor_coverage.push_execution import Moved, PushExecution
from zwerm.deploy.node_specs import node_specs
from zwerm.maths.simplicial import FlagComplex
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.wire.messages import Wake

# Ten files of 8 robots around a station (0): 1 to 8, 11 to 18, and so on.
FILES, LENGTH = 10, 8
STAR = FlagComplex(
    {0: [10 * file + 1 for file in range(FILES)]}
    | {
        10 * file + n: [10 * file + n - 1 if n > 1 else 0, *([10 * file + n + 1] if n < LENGTH else [])]
        for file in range(FILES)
        for n in range(1, LENGTH + 1)
    }
)
HALL = "arena.size_m=[4.4,3.6]", "base.pose=[0.2,1.8,0.3]", "robots.count=60"


def log_of(drives: str) -> AttemptLog:
    """Return the log of drives beside edges: each is over the whole hop (+), or a wall stopped it (-)."""
    log = AttemptLog(1, 0.3)
    for number, each in enumerate(drives):
        log.note_attempt((number, number + 1, 1))
        if each == "-":
            log.note_failure((number, number + 1, 1), number, 0.0, 0.1)
    return log


def assigned(
    movers: Sequence[int], pushes_max: int = 9, bases: tuple[int, ...] = (0,), side: int = 0, drives: str = ""
) -> list[tuple[int, bool]]:
    """Return the mover of each assigned plan, and whether its leader waits."""

    def routes(part: FlagComplex, starts: dict[int, float]) -> CheapestRoutes:
        return Dijkstra(3.0).routes(part, starts, ())

    plans = [Plan((each, each, side), each, 0.0, 0.95, 0.8, (each,)) for each in movers]
    service = CheapestFirst(Slots(), pushes_max, log_of(drives))
    found = service.assign([plans], ScanResult({}, STAR, bases), {0: 0.0}, routes)  # type: ignore[arg-type]
    assert all(each.path[0] == 0 and each.path[-1] == each.mover for each in found)
    return [(each.mover, each.waits) for each in found]


def test_leaders_of_different_files_drive_at_once_and_those_with_longer_paths_wait() -> None:
    assert assigned([8, 17, 26]) == [(26, False), (17, True), (8, True)]


def test_leaders_that_drive_beside_edges_do_so_one_after_the_other() -> None:
    assert assigned([8, 17, 26], side=1) == [(26, False)]


@pytest.mark.parametrize(
    ("drives", "at_once"),
    [("+++++---", False), ("+--+-----", True), ("----------++++++++", False), ("---", False), ("------", True)],
)
def test_they_do_so_at_once_where_walls_stop_most_of_them(drives: str, at_once: bool) -> None:
    assert log_of(drives).walls_stop_most == at_once
    assert len(assigned([8, 17, 26], side=1, drives=drives)) == (3 if at_once else 1)


def test_drives_into_gaps_do_not_count_for_that() -> None:
    log = AttemptLog(1, 0.3)
    for number in range(10):
        log.note_attempt((number, number, 0))
        log.note_failure((number, number, 0), number, 0.0, 0.1)
    assert not log.walls_stop_most


def test_a_leader_does_not_drive_beside_the_path_of_an_earlier_push_or_close_to_its_leader() -> None:
    assert assigned([8, 11]) == [(11, False), (8, True)]
    assert assigned([3, 11]) == [(11, False), (3, True)]
    assert assigned([2, 11]) == [(11, False)], "three edges away"
    assert LEADERS_APART_EDGES == 3
    assert assigned([8, 1, 7]) == [(1, False), (7, True)]


def test_the_number_of_leaders_that_wait_is_bounded() -> None:
    movers = range(8, 100, 10)
    assert len(assigned(movers, 99)) == 1 + WAITING_MAX
    assert len(assigned(movers, 2)) == 2
    assert len(assigned(movers, 1)) == 1


def test_only_the_robots_of_stations_follow_a_leader_that_waits() -> None:
    assert assigned([8, 17], bases=()) == [(17, False)]


def test_robots_follow_in_the_order_of_plans_whoever_is_clear_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second path leads through the slot that the first leader has left."""
    coordinator = Node(*node_specs(load("sensor-coverage", ("robots.count=3",)), 1)[3])._controller
    assert isinstance(coordinator, SensorCoverageCoordinator)
    order, drives = list[int](), {4: 3, 8: 1}

    def lead(_: PushExecution, plan: Plan) -> Routine[tuple[int, dict[int, Arrived] | None]]:
        yield from [Wake()] * drives[plan.mover]
        return plan.mover, {}

    def follow(_: PushExecution, plan: Plan, leader: int, there: bool) -> Routine[Moved]:
        order.append(leader)
        yield Wake()
        return (leader,)

    monkeypatch.setattr(PushExecution, "_lead", lead)
    monkeypatch.setattr(PushExecution, "_follow", follow)
    plans = [Plan((n, n, 0), n, 0.0, 0.95, 0.8, (n,), tuple(range(n + 1)), waits=True) for n in drives]
    for _ in coordinator.pushing.push_all(plans):
        pass
    assert order == [4, 8]


@pytest.mark.parametrize(("seed", "faults"), [(1, ""), (2, '{kind="crash", fraction=0.1, between_s=[20.0, 200.0]}')])
def test_a_hall_is_filled_with_leaders_that_wait(seed: int, faults: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With seeds 1 and 3 bodies come to lie between robots that stand, and 2,000 s are not enough: see the docs."""
    waiting = [0]
    push = PushExecution.push_all

    def counted(self: PushExecution, plans: Sequence[Plan]) -> Moved:
        waiting.append(sum(each.waits for each in plans))
        return push(self, plans)  # type: ignore[return-value]

    monkeypatch.setattr(PushExecution, "push_all", counted)
    result = run("sensor-coverage", seed, "inline", (*HALL, f"faults=[{faults}]"))
    assert result.outcome == "completed"
    assert result.metrics["reachable_coverage_fraction"] > 0.98
    assert max(waiting) > 1
