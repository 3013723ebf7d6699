"""A robot without a coordinator divides its messages into commands that the world accepts, and bounds the longest ones."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.proofs.slot_proof import SlotProof
from zwerm.agents.sensor_coverage.local_node import CODECS
from zwerm.agents.sensor_coverage.messages.beacons import StateRequest
from zwerm.agents.sensor_coverage.messages.commands import NearWalls, Response, Sighting, Walked, Waypoint
from zwerm.agents.sensor_coverage.messages.commands import write as write_command
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL, read_envelope, write
from zwerm.agents.sensor_coverage.messages.pushes import LeaderReady, ProvedArc, Segment, SlotMemory, WalkTriangle
from zwerm.agents.sensor_coverage.motion.walls.waypoint_choice import LEG_BYTES_MAX, SIGHTING_BYTES, WAYPOINT_BYTES
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.agents.sensor_coverage.protocols.component_loop import ComponentLoop
from zwerm.wire.messages import MESSAGE_BYTES_MAX, Command, encode_command, open_answer

# The longest numbers of MessagePack.
SLOT = 2**31


class Talker(Component):
    """Sends what it has, each message once."""

    channel = CHANNEL

    def __init__(self, out: list[Outgoing]) -> None:
        self.out = out

    def outgoing(self) -> list[Outgoing]:
        sent, self.out = self.out, []
        return sent


@pytest.mark.parametrize("snapshot_bytes", [0, 30_000])
def test_messages_that_do_not_fit_into_one_command_are_sent_in_the_next_ones(snapshot_bytes: int) -> None:
    asked = [StateRequest(tuple(range(number, number + 3_000))) for number in range(20)]
    talker = Talker([Outgoing(5, each) for each in asked])
    loop = ComponentLoop((talker,), CODECS)
    sent, ticks = [], 0
    while packets := loop.outbox(snapshot_bytes):
        payload = encode_command(Command(tick=2**40, outbox=packets, snapshot=bytes(snapshot_bytes)))
        assert len(payload) <= MESSAGE_BYTES_MAX
        open_answer(payload)
        sent += [read_envelope(each.payload) for each in packets]
        ticks += 1
        waits = len(sent) < len(asked)
        assert (loop.next_wake() is not None) == waits, "the robot is awake at the next tick while packets wait"
        assert loop.is_idle(ticks) != waits
        if waits and not talker.out:
            talker.out = [Outgoing(5, StateRequest(()))]  # it waits until the others are sent
    assert [each.message for each in sent if each is not None] == [*asked, StateRequest(())]
    assert ticks > 3


@pytest.mark.parametrize("slots", [2, 10, 40])
def test_the_memory_of_a_slot_fits_into_a_command(slots: int) -> None:
    proof = SlotProof()
    others = tuple(SLOT + each for each in range(slots))
    known = _arcs(others)
    proof.inherit(known)
    memory = proof.memory()
    assert 90 <= len(memory) <= 300
    assert {each.needed for each in memory} <= {each.needed for each in known}
    message = LeaderReady(SLOT, ((SLOT, SLOT),) * 30, SlotMemory(SLOT, (), (), (), (), (), (), proved=memory), SLOT)
    payload = write(Segment(SLOT, message), SLOT, SLOT, SLOT, 4)
    assert len(payload) < MESSAGE_BYTES_MAX - 5_000, "references, walls and attempts have the rest"


def test_the_waypoints_of_the_longest_leg_fit_into_a_command() -> None:
    for robots in (0, 5, 60):
        sightings = tuple(Sighting(SLOT + each, math.pi) for each in range(robots))
        point = Waypoint(math.pi, math.pi, sightings, (math.pi,) * 3, (SLOT,) * 2)
        bytes_each = WAYPOINT_BYTES + robots * SIGHTING_BYTES
        leg = (point,) * (1 + LEG_BYTES_MAX // bytes_each)
        near = NearWalls(((math.pi, math.pi),) * 150, ((math.pi, math.pi),) * 50)
        walked = Walked(SLOT, "stretch", math.pi, math.pi, math.pi, leg, near, math.pi)
        assert len(write_command(Response(SLOT, SLOT, SLOT, SLOT, SLOT, walked))) < MESSAGE_BYTES_MAX - 5_000


def _arcs(others: tuple[int, ...]) -> tuple[ProvedArc, ...]:
    """Return 600 arcs that rely on these slots, a half of them angles of triangles."""
    triangle = WalkTriangle(others[0], -1, math.pi, SLOT, SLOT, SLOT, -1)
    found = []
    for number in range(300):
        needed = (*others, 3 * SLOT + number)
        found.append(ProvedArc(needed, others, 0.01 * number, 0.005, triangle._replace(number=number)))
        found.append(ProvedArc(needed, others, 0.01 * number, 0.005))
    return tuple(found)
