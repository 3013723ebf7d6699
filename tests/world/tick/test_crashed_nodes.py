"""A node that the run has given up acts for no body."""

import pytest
from support import scenario

from zwerm.errors import ProtocolError
from zwerm.run.assembly import assemble
from zwerm.wire.messages import Command, WheelSpeeds, encode


def test_the_commands_of_a_crashed_node_are_refused_and_counted_also_where_late_answers_count() -> None:
    world = assemble(scenario(robots={"on_crash": "continue"}), 1)
    world.observe()
    world.crash(0, "process ended")
    before = world.scene.position[0].copy()
    for _ in range(5):
        for late_allowed in (True, False):
            with pytest.raises(ProtocolError, match=r"^crashed: node 0 crashed at tick 0$"):
                world.accept(0, encode(Command(tick=world.tick, drive=WheelSpeeds(0.1, 0.1))), late_allowed)
        world.advance()
        world.observe()
    assert (world.scene.position[0] == before).all()
    assert world.intake.refusals.by_reason == {"crashed": 10}
