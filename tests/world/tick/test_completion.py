"""One rule decides when a run ends, and both drivers follow it."""

from collections.abc import Sequence
from typing import Any

import pytest
from support import scenario

from zwerm.link import Answer
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.wire.messages import Command, Failure, decode_observation, encode
from zwerm.world.drivers.driver import Driver
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.drivers.realtime import RealTime
from zwerm.world.tick.completion import COMPLETED, FAILED, TIME_LIMIT, Completion, Ending

COORDINATOR: dict[str, Any] = {"coordinator": {"controller": "sensor-coverage"}}
BASE: dict[str, Any] = {"base": {"controller": "random-walk", "pose": [1.0, 1.0, 0.0]}}


def completion(done: Sequence[int], **tables: Any) -> Completion:
    found = Completion(scenario(**tables))
    for node in done:
        found.report(node, True)
    return found


@pytest.mark.parametrize(
    ("done", "exited", "dead", "tables", "completed"),
    [
        ([], [], [], {}, False),
        ([0, 1, 2], [], [], {}, False),
        ([0, 1, 2, 3], [], [], {}, True),
        ([0, 1, 2], [3], [], {}, True),
        ([0, 1, 2], [], [3], {}, True),
        ([], [], [0, 1, 2, 3], {}, False),
        ([0, 1, 2, 3], [], [], COORDINATOR, False),
        ([4], [], [], COORDINATOR, True),
        ([0], [], [], BASE, True),
        ([1, 2, 3], [], [], BASE, False),
    ],
)
def test_the_task_is_done_when_the_deciding_node_or_every_living_robot_reports_it(
    done: list[int], exited: list[int], dead: list[int], tables: dict[str, Any], completed: bool
) -> None:
    assert completion(done, **tables).completed(exited, dead) is completed


def test_a_restarted_robot_is_not_done() -> None:
    found = completion([0, 1, 2, 3])
    found.restart(2)
    assert not found.completed([], [])


def test_only_a_deciding_node_gives_up_for_all_and_a_station_only_without_its_coordinator() -> None:
    def ending(node: int, dead: Sequence[int] = (), **tables: Any) -> Ending | None:
        found = Completion(scenario(**tables))
        found.give_up(node, "lost", dead)
        return found.ending(0, {}, [], [])

    assert ending(1) is None
    assert ending(4, **COORDINATOR) == Ending(FAILED, "node 4 gave up: lost")
    assert ending(0, **BASE) == Ending(FAILED, "node 0 gave up: lost")
    assert ending(0, **BASE, **COORDINATOR) is None
    assert ending(0, [4], **BASE, **COORDINATOR) == Ending(FAILED, "node 0 gave up: lost")


def test_where_no_node_decides_the_run_fails_once_every_living_robot_is_done_or_gave_up() -> None:
    found = completion([0])
    found.give_up(2, "blocked", [])
    found.give_up(3, "cut off", [])
    assert found.ending(0, {}, [], []) is None
    assert found.ending(0, {}, [], [1]) == Ending(FAILED, "node 2 gave up: blocked")
    assert found.ending(0, {}, [1], []) == Ending(FAILED, "node 2 gave up: blocked")
    assert found.ending(0, {}, [], [1, 2]) == Ending(FAILED, "node 3 gave up: cut off")
    assert found.ending(0, {}, [], [1, 2, 3]) == Ending(COMPLETED), "those that gave up died"
    found.give_up(2, "", [])
    assert found.ending(0, {}, [], [1]) is None
    found.give_up(2, "blocked", [])
    found.restart(2)
    assert found.ending(0, {}, [], [1]) is None


def test_a_crash_takes_precedence_over_the_end_of_the_task_and_that_over_the_time_limit() -> None:
    found = completion([0, 1, 2, 3])
    crash = Ending(FAILED, "node 2 crashed at tick 20: Oops")
    assert found.ending(20, {2: "Oops"}, [], [2]) == crash == found.crash_ending(20, {2: "Oops"})
    assert found.ending(20, {}, [], []) == Ending(COMPLETED)
    assert completion([]).ending(20, {}, [], []) == Ending(TIME_LIMIT)
    assert completion([]).ending(19, {}, [], []) is None


def test_a_crash_ends_no_run_that_continues_on_crash() -> None:
    found = completion([], robots={"on_crash": "continue"})
    assert found.ending(3, {2: "Oops"}, [], [2]) is None


def answering(node: int) -> Answer:
    """Return a node that does nothing; node 2 raises at tick 5."""

    def answer(payload: bytes) -> bytes:
        tick = decode_observation(payload).tick
        return encode(Failure(tick, "Oops", "") if (node, tick) == (2, 5) else Command(tick=tick))

    return answer


@pytest.mark.parametrize("paced", [False, True])
def test_lock_step_and_real_time_end_a_run_by_the_same_rule(paced: bool) -> None:
    world = assemble(scenario(), 1)
    link = MemoryLink({node: answering(node) for node in range(4)})
    seen: list[int] = []
    observers = [lambda world: seen.append(world.tick)]
    driver: Driver = RealTime(world, link, 50.0, observers) if paced else LockStep(world, link, observers)
    assert driver.run() == FAILED
    assert driver.reason == "node 2 crashed at tick 5: Oops"
    assert seen == [1, 2, 3, 4, 5], "observers are called once a tick, after it"
