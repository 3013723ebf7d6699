"""The beacon: it counts received and missed packets, and drives straight on if a speed is set."""

import pytest
from support import scenario

from zwerm.agents.gossip import Beacon
from zwerm.agents.runtime.contract import Body, Setup
from zwerm.maths.keyed_random import Draws
from zwerm.run.runner import run
from zwerm.wire.messages import Observation, Packet

BODY = Body("holonomic", radius_m=0.05, max_speed_m_s=0.5, max_turn_rad_s=1.0, wheel_base_m=0.0)


def beacon(node: int) -> Beacon:
    return Beacon(Setup(node, "robot", 0.1, (), Draws(1).stream_key("controller", node), BODY, ("robots",), {}))


def test_a_beacon_counts_received_missing_and_damaged_packets() -> None:
    sender, hearer = beacon(1), beacon(2)
    frames = [sender.step(Observation(tick, 0.1 * tick)).outbox[0].payload for tick in range(6)]
    for tick, number in enumerate((0, 1, 4, 5)):
        hearer.step(Observation(tick, 0.1 * tick, (Packet("robots", frames[number], 1),)))
    damaged = bytes([frames[5][0] ^ 1]) + frames[5][1:]
    hearer.step(Observation(4, 0.4, (Packet("robots", damaged, 1),)))
    assert (hearer.received, hearer.missed, hearer.refused) == ({1: 4}, {1: 2}, 1)


@pytest.mark.parametrize("kind", ["holonomic", "differential"])
@pytest.mark.parametrize(("speed_m_s", "far_m"), [(0.0, 0.0), (0.1, 0.2)])
def test_a_beacon_drives_straight_on_with_and_without_wheels(kind: str, speed_m_s: float, far_m: float) -> None:
    robots = {
        "count": 1,
        "controller": "beacon",
        "parameters": {"speed_m_s": speed_m_s},
        "sensors": [],
        "body": {"kind": kind},
        "placement": {"kind": "poses", "poses": [[1.0, 1.0, 0.0]]},
    }
    result = run(scenario(robots=robots, radio={}), 1, "inline")
    assert result.history.arrays().position[-1, 0] == pytest.approx([1.0 + far_m, 1.0], abs=0.01)
