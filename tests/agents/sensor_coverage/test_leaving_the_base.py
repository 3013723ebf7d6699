"""The first robot leaves the base, or the only way is blocked by the bodies of robots that have died."""

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.local_base import LocalBase
from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, StateBeacon
from zwerm.agents.sensor_coverage.messages.pushes import PushAborted
from zwerm.agents.sensor_coverage.protocols.push_scheduler import LEAVES_MAX
from zwerm.deploy.node_specs import node_specs
from zwerm.run.runner import run
from zwerm.scenario.load import load

SCENARIO = load("sensor-coverage", ("robots.count=14", "services.path=gradient"))
# A passage of 0.3 m that ends in a hall: the way to its wall leads nearly out of it.
PASSAGE = "[[0,0],[0.8,0],[0.8,-1],[2.6,-1],[2.6,1.2],[1.1,1.2],[1.1,0.3],[0,0.3]]"


def test_the_first_robot_stays_where_its_drive_to_a_wall_has_led_out_of_a_passage() -> None:
    settings = (f"arena.polygon={PASSAGE}", "base.pose=[0.15,0.15,0.3]", "services.path=gradient", "robots.count=30")
    result = run("sensor-coverage-narrow", 1, "inline", (*settings, "time.duration_s=60.0"))
    assert result.outcome == "time-limit"  # it has not given up
    assert result.metrics["robots_deployed"] > 2.0


def outcome_after(attempts: int, released: int) -> str:
    """Return the outcome after attempts in which the first robot did not get away from the base."""
    base = Node(*node_specs(SCENARIO, 1)[0])._controller
    assert isinstance(base, LocalBase)
    base.schedule.see(list(range(1, released + 1)))
    for tick in range(attempts):
        push = base.schedule._begin(tick, first=True, rear=released)
        base.schedule.receive(released, PushAborted(push, True), tick)
    return base.schedule.outcome.partition(":")[0]


def test_a_base_that_no_robot_has_ever_left_gives_up_at_once() -> None:
    assert outcome_after(1, 1) == "source-blocked"


def test_a_base_whose_neighbours_have_died_tries_again_before_it_gives_up() -> None:
    """The next robot may not know yet that the bodies in its way are dead, and robots that are cut off come back."""
    assert outcome_after(LEAVES_MAX - 1, 3) == ""
    assert outcome_after(LEAVES_MAX, 3) == "source-blocked"


@pytest.mark.parametrize("redundant", [True, False])
def test_a_base_whose_only_neighbour_has_left_the_complex_releases_a_robot(redundant: bool) -> None:
    """That robot plans nothing, so the base would wait for a frontier for ever, or conclude that there is none."""
    base = Node(*node_specs(SCENARIO, 1)[0])._controller
    assert isinstance(base, LocalBase)
    base.situation.motion.frame.seen = {3: 0.5}
    base.local_map.receive(3, StateBeacon(0, 5, 1, False, False, 1, (), (), (), NO_PATH_VECTOR, redundant), 1)
    base.schedule.poll(2)
    assert base.schedule.release is redundant
