"""Commands to follow walls name the robots that do not answer."""

import pytest

from zwerm.agents.sensor_coverage.messages.commands import (
    FollowWall,
    FollowWallPastDead,
    Probe,
    ProbePastDead,
    Request,
    ToWall,
    ToWallPastDead,
    read_request,
    write,
)
from zwerm.coordinator.sensor_coverage.wall_walks import DEAD_MAX, past_dead

COMMANDS = ToWall(3, 0.5, 1.0, 0.3, -1, 0.2), FollowWall(3, 3.0, 1, (4,), (5, 6)), Probe(3, 0.5, 0.14, 1, 0.2)
KINDS = ToWallPastDead, FollowWallPastDead, ProbePastDead


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_is_the_same_while_all_robots_answer(command: ToWall | FollowWall | Probe) -> None:
    assert past_dead(command, {}) is command


@pytest.mark.parametrize(("command", "kind"), list(zip(COMMANDS, KINDS, strict=True)))
def test_a_command_names_the_robots_that_fell_silent_last(command: ToWall | FollowWall | Probe, kind: type) -> None:
    named = past_dead(command, dict.fromkeys(range(2 * DEAD_MAX)))
    assert isinstance(named, kind)
    assert isinstance(named, KINDS)
    assert named.dead == tuple(range(DEAD_MAX, 2 * DEAD_MAX))
    assert [getattr(named, each) for each in command.__struct_fields__] == [
        getattr(command, each) for each in command.__struct_fields__
    ]
    sealed = write(Request(1, 2, 3, 4, named))
    assert len(sealed) < 3 * DEAD_MAX + 100
    request = read_request(sealed)
    assert request is not None
    assert request.command == named
