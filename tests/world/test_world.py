"""The world without any link: time, drives, wake rule, radio accounts, depots, and the treatment of robots that crash."""

import math

import msgspec
import numpy as np
import pytest
from support import scenario

from zwerm.run.assembly import assemble
from zwerm.wire.messages import (
    BodyVelocity,
    Command,
    Failure,
    Observation,
    Transmission,
    Wake,
    WheelSpeeds,
    decode_observation,
    encode,
)
from zwerm.world.metrics.position_coverage import area_coverage_fraction, cell_counts, cell_coverage_fraction
from zwerm.world.world import World


def world_at(*poses: tuple[float, float, float], **tables: object) -> World:
    """Return a world whose robots stand at `poses`, with holonomic bodies and no sensors unless `tables` say otherwise."""
    robots = {
        "count": len(poses),
        "controller": "random-walk",
        "sensors": [],
        "body": {"kind": "holonomic", "radius_m": 0.1, "max_speed_m_s": 1.0},
        "placement": {"kind": "poses", "poses": list(poses)},
    } | dict(tables.pop("robots", {}))  # type: ignore[call-overload]
    return assemble(scenario(arena={"size_m": [4.0, 4.0]}, robots=robots, **tables), 1)


def tick(world: World, **commands: Command) -> dict[int, Observation]:
    """Go on by one tick; `n0=Command(...)` is node 0's answer, the others answer nothing special. Return what was observed."""
    nodes, payloads = world.observe()
    for node in nodes:
        command = commands.get(f"n{node}", Command())
        command.tick = world.tick
        world.accept(node, encode(command))
    world.advance()
    return dict(zip(nodes, map(decode_observation, payloads), strict=True))


def test_a_drive_is_in_the_body_frame_and_persists() -> None:
    world = world_at((2.0, 2.0, math.pi / 2))
    tick(world, n0=Command(drive=BodyVelocity(forward_m_s=0.5, left_m_s=0.2)))
    for _ in range(9):
        tick(world)
    assert world.scene.position[0] == pytest.approx([2.0 - 0.2, 2.0 + 0.5])
    tick(world, n0=Command(drive=BodyVelocity()))
    before = world.scene.position[0].copy()
    tick(world)
    assert (world.scene.position[0] == before).all()


@pytest.mark.parametrize("latency", [0, 1, 3])
def test_a_command_acts_after_the_latency_of_the_body(latency: int) -> None:
    body = {"kind": "holonomic", "max_speed_m_s": 1.0, "latency_ticks": latency}
    world = world_at((2.0, 2.0, 0.0), robots={"body": body})
    tick(world, n0=Command(drive=BodyVelocity(1.0)))
    moved = [world.scene.moved[0]]
    tick(world, n0=Command(drive=BodyVelocity(0.0)))
    moved.append(world.scene.moved[0])
    for _ in range(4):
        tick(world)
        moved.append(world.scene.moved[0])
    assert np.flatnonzero(moved).tolist() == [latency]
    assert world.scene.position[0, 0] == pytest.approx(2.1)


def test_a_turning_differential_drive_follows_its_circle() -> None:
    body = {"kind": "differential", "wheel_base_m": 0.2, "max_speed_m_s": 1.0}
    world = world_at((2.0, 2.0, 0.0), robots={"body": body})
    radius, omega = 0.5, 0.5  # v = omega R; wheels (R -+ b/2) omega
    wheels = WheelSpeeds((radius - 0.1) * omega, (radius + 0.1) * omega)
    quarter_ticks = round(math.pi / 2 / omega / 0.1)
    for _ in range(quarter_ticks):
        tick(world, n0=Command(drive=wheels))
    angle = omega * 0.1 * quarter_ticks
    centre = np.array([2.0, 2.0 + radius])
    assert world.scene.heading[0] == pytest.approx(angle)
    assert world.scene.position[0] == pytest.approx(
        centre + radius * np.array([math.sin(angle), -math.cos(angle)]), abs=1e-4
    )


def test_drives_are_clamped_to_what_the_motors_can_do() -> None:
    world = world_at((2.0, 2.0, 0.0))
    tick(world, n0=Command(drive=BodyVelocity(30.0, 40.0)))
    assert world.scene.position[0] == pytest.approx([2.06, 2.08])


def test_walls_and_bodies_stop_bodies_and_no_body_passes() -> None:
    world = world_at((0.5, 2.0, math.pi), (1.5, 2.0, math.pi))
    for _ in range(30):
        tick(world, n0=Command(drive=BodyVelocity(1.0)), n1=Command(drive=BodyVelocity(1.0)))
    assert world.scene.position[0] == pytest.approx([0.1, 2.0], abs=0.01)
    assert world.scene.position[1] == pytest.approx([0.3, 2.0], abs=0.02)
    assert world.scene.heading.tolist() == [math.pi, math.pi]


def test_a_robot_slides_along_a_wall_without_friction() -> None:
    world = world_at((2.0, 0.1, -math.pi / 4))
    for _ in range(10):
        tick(world, n0=Command(drive=BodyVelocity(0.5)))
    assert world.scene.position[0] == pytest.approx([2.0 + 0.5 / math.sqrt(2), 0.1], abs=0.005)


def test_a_world_in_which_no_robot_moves_is_not_stepped() -> None:
    world = world_at((1.0, 1.0, 0.0))
    tick(world)
    tick(world)
    assert not world.scene.moved.any()
    tick(world, n0=Command(drive=BodyVelocity(0.1)))
    assert world.scene.moved.tolist() == [True]


def test_a_sleeper_is_observed_again_when_its_time_comes_and_its_drive_persists_meanwhile() -> None:
    world = world_at((1.0, 1.0, 0.0), (1.0, 3.0, 0.0))
    seen = [list(tick(world, n0=Command(drive=BodyVelocity(0.1), wake=Wake(at_s=0.5))))]
    seen += [list(tick(world)) for _ in range(6)]
    assert seen == [[0, 1], [1], [1], [1], [1], [0, 1], [0, 1]]
    assert world.scene.position[0, 0] == pytest.approx(1.0 + 0.1 * 0.7)
    assert world.intake.observed_count == 10


def test_a_sleeper_with_no_event_sleeps_until_the_run_ends() -> None:
    world = world_at((1.0, 1.0, 0.0), (1.0, 3.0, 0.0))
    tick(world, n0=Command(wake=Wake()))
    assert [list(tick(world)) for _ in range(3)] == [[1], [1], [1]]


def test_a_packet_wakes_a_sleeper_that_asked_for_packets_and_no_other() -> None:
    world = world_at((1.0, 1.0, 0.0), (1.0, 2.0, 0.0), (1.0, 3.0, 0.0), radio={})
    tick(world, n0=Command(wake=Wake(on_packet=True)), n1=Command(wake=Wake(at_s=9.0)))
    assert list(tick(world, n2=Command(outbox=(Transmission("robots", b"up"),)))) == [2]
    observed = tick(world)
    assert list(observed) == [0, 2]
    assert [packet.payload for packet in observed[0].inbox] == [b"up"]
    assert world.medium.summary()["in_flight"] == 1, "the packet to the sleeper waits for it"


def test_a_contact_wakes_a_sleeper_that_asked_for_contacts() -> None:
    world = world_at((1.0, 1.0, 0.0), (2.0, 1.0, math.pi), robots={"sensors": [{"kind": "touch"}]})
    tick(world, n0=Command(wake=Wake(on_contact=True)), n1=Command(drive=BodyVelocity(1.0)))
    woken = next(number for number in range(1, 20) if 0 in tick(world))
    assert woken == 8
    assert world.scene.position[1, 0] - world.scene.position[0, 0] == pytest.approx(0.2, abs=0.02)


def test_a_change_of_visible_ids_wakes_a_sleeper_that_asked_for_it() -> None:
    robots = {"sensors": [{"kind": "bearings", "range_m": 1.0}]}
    world = world_at((1.0, 1.0, 0.0), (2.45, 1.0, math.pi), robots=robots)
    tick(world, n0=Command(wake=Wake(on_visible=True)), n1=Command(drive=BodyVelocity(1.0)))
    woken = next(number for number in range(1, 20) if 0 in tick(world))
    assert woken == 5


def test_radio_packets_arrive_one_tick_later_and_every_one_is_accounted_for() -> None:
    world = world_at((0.5, 0.5, 0.0), (1.0, 0.5, 0.0), (3.5, 3.5, 0.0), radio={"range_m": 1.0})
    tick(world, n0=Command(outbox=(Transmission("robots", b"hello"), Transmission("robots", b"you", to=1))))
    assert world.medium.summary() | {"bytes": 0} == {
        "sent": 3,
        "delivered": 0,
        "dropped": {"out-of-range": 1},
        "in_flight": 2,
        "out_of_reach": 1,
        "bytes": 0,
        "copies": 0,
        "damaged": 0,
    }
    observed = tick(world)
    assert [(p.payload, p.sender, p.channel) for p in observed[1].inbox] == [
        (b"hello", 0, "robots"),
        (b"you", 0, "robots"),
    ]
    assert observed[2].inbox == ()
    found = world.medium.summary()
    assert (found["sent"], found["delivered"], found["in_flight"], found["bytes"]) == (3, 2, 0, 8)
    assert world.medium.channels["robots"].ledger.by_link() == {
        "sender": [0, 0],
        "receiver": [1, 2],
        "sent": [2, 1],
        "delivered": [2, 0],
        "dropped": {"out-of-range": [0, 1]},
        "out_of_reach": [0, 1],
        "in_flight": [0, 0],
    }


def test_walls_block_the_radio_if_the_scenario_sets_line_of_sight() -> None:
    tables = {"radio": {"line_of_sight": True}}
    walled = scenario(
        arena={"size_m": [4.0, 4.0], "walls": [[[2.0, 0.0], [2.0, 3.0]]]},
        robots={"count": 2, "controller": "random-walk", "sensors": [],
                "placement": {"kind": "poses", "poses": [[1.0, 1.0, 0.0], [3.0, 1.0, 0.0]]}},
        **tables,
    )  # fmt: skip
    world = assemble(walled, 1)
    tick(world, n0=Command(outbox=(Transmission("robots", b"x"),)))
    assert world.medium.summary()["dropped"] == {"no-line-of-sight": 1}


def test_an_anonymous_channel_hides_the_sender() -> None:
    world = world_at((0.5, 0.5, 0.0), (1.0, 0.5, 0.0), radio={"anonymous": True})
    tick(world, n0=Command(outbox=(Transmission("robots", b"x"),)))
    assert tick(world)[1].inbox[0].sender is None


def test_a_crashed_robot_stops_is_never_awaited_again_and_its_packets_are_dropped_with_a_cause() -> None:
    world = world_at((0.5, 0.5, 0.0), (1.5, 0.5, 0.0), radio={})
    tick(world, n1=Command(drive=BodyVelocity(1.0), outbox=(Transmission("robots", b"x"),)))
    tick(world, n0=Command(outbox=(Transmission("robots", b"y"),)))
    nodes, _ = world.observe()
    assert nodes == [0, 1]
    world.accept(0, encode(Command(tick=world.tick)))
    world.accept(1, encode(Failure(world.tick, "Oops", "")))
    assert world.awaited() == []
    world.advance()
    halted = world.scene.position[1].copy()
    assert list(tick(world)) == [0]
    assert (world.scene.position[1] == halted).all()
    assert world.status.crashed == {1: "Oops"}


def trace_of(*, precomputing: bool, latency_ticks: int) -> str:
    """Return the trace of robots that come and go, drive, sleep and crash, in a world that precomputes or does not."""
    entrance = {"every_s": 0.3, "entry_m": [0.0, 0.0, 1.0, 4.0], "exit_m": [1.5, 0.0, 4.0, 4.0]}
    body = {"kind": "holonomic", "radius_m": 0.1, "max_speed_m_s": 2.0, "latency_ticks": latency_ticks}
    sensors = [
        {"kind": "odometry", "distance_sd_fraction": 0.1},
        {"kind": "bearings", "sd_rad": 0.1},
        {"kind": "line_of_sight"},
    ]
    robots = {"count": 12, "entrance": entrance, "body": body, "sensors": sensors, "on_crash": "continue"}
    noise = {"kind": "sensor_noise", "sensor": "bearings", "at_s": 0.8, "for_s": 0.4, "sd": 0.1}
    world = world_at(robots=robots, faults=[noise])
    answer = {7: Command(drive=BodyVelocity(1.8)), 16: Command(wake=Wake(at_s=2.0))}
    while world.tick < 40:
        world.begin()
        nodes, _ = world.observe()
        if precomputing:
            world.precompute()
        for node in nodes:
            message: Command | Failure = answer.get(
                world.tick + node, Command(drive=BodyVelocity(1.9, 0.0, 0.05 * node))
            )
            failed = world.tick == 30 and node == nodes[0]
            message = Failure(world.tick, "Oops", "") if failed else msgspec.structs.replace(message, tick=world.tick)
            world.accept(node, encode(message))
        world.advance()
    assert world.bodies.exited
    assert world.status.crashed
    return world.trace.hex()


def test_precomputing_changes_no_trace_when_robots_enter_leave_sleep_or_lose_their_camera() -> None:
    traces = [trace_of(precomputing=True, latency_ticks=latency) for latency in (0, 1, 3)]
    assert traces == [trace_of(precomputing=False, latency_ticks=latency) for latency in (0, 1, 3)]
    assert len(set(traces)) == 3


def test_precomputed_readings_are_not_sensed_again() -> None:
    body = {"kind": "holonomic", "latency_ticks": 1}
    world = world_at(
        (1.0, 1.0, 0.0), (2.0, 1.0, 0.0), robots={"sensors": [{"kind": "bearings", "sd_rad": 0.1}], "body": body}
    )
    (sensor,) = world._sensing.sensors.values()
    asked = []
    read = sensor.read
    sensor.read = lambda scene, robots: (asked.append(scene.tick), read(scene, robots))[1]  # type: ignore[method-assign]
    for _ in range(3):
        nodes, _ = world.observe()
        world.precompute()
        for node in nodes:
            world.accept(node, encode(Command(tick=world.tick)))
        world.advance()
    assert asked == [0, 1, 2, 3]


def test_robots_flow_in_through_the_entry_and_out_through_the_exit() -> None:
    entrance = {"every_s": 0.5, "entry_m": [0.0, 0.0, 1.0, 4.0], "exit_m": [3.0, 0.0, 4.0, 4.0]}
    robots = {"count": 3, "entrance": entrance, "body": {"kind": "holonomic", "radius_m": 0.1, "max_speed_m_s": 2.0}}
    world = world_at((0.5, 0.5, 0.0), robots=robots | {"placement": {}})
    there = []
    for _ in range(60):
        commands = {
            f"n{node}": Command(drive=BodyVelocity(math.cos(h), -math.sin(h)))
            for node, h in enumerate(world.scene.heading.tolist())
        }
        there.append(sorted(tick(world, **commands)))
    assert there[0] == [0]
    assert there[5] == [0, 1]
    assert there[10] == [0, 1, 2]
    assert sorted(world.bodies.exited) == [0, 1, 2]
    assert not world.scene.present.any()
    assert world.completed


def test_a_base_station_releases_robots_one_by_one_and_decides_when_the_run_is_complete() -> None:
    base = {"controller": "random-walk", "pose": [2.0, 2.0, 0.5]}
    world = world_at((1.0, 1.0, 0.0), (1.0, 2.0, 0.0), (1.0, 3.0, 0.0), base=base, robots={"placement": {}})
    assert list(tick(world, n0=Command(release=True))) == [0]
    assert list(tick(world, n1=Command(drive=BodyVelocity(1.0), release=True, done=True))) == [0, 1], (
        "only the base releases"
    )
    assert world.scene.position[1] == pytest.approx([2.0 + 0.1 * math.cos(0.5), 2.0 + 0.1 * math.sin(0.5)])
    assert world.scene.position[0].tolist() == [2.0, 2.0]
    assert not world.completed
    tick(world, n0=Command(release=True))
    assert list(tick(world, n0=Command(release=True, done=True))) == [0, 1, 2]
    assert world.completed


def test_the_coordinator_receives_from_all_robots_over_the_uplink_and_senses_nothing() -> None:
    coordinator = {"controller": "sensor-coverage"}
    world = world_at(
        (1.0, 1.0, 0.0), (3.0, 3.0, 0.0), coordinator=coordinator, radio={"range_m": 0.1},
        robots={"sensors": [{"kind": "pose"}]},
    )  # fmt: skip
    up = Command(outbox=(Transmission("uplink", b"up"),))
    tick(world, n1=up, n2=Command(outbox=(Transmission("uplink", b"down"), Transmission("uplink", b"you", to=1))))
    observed = tick(world)
    assert observed[2].pose is None
    assert [(packet.sender, packet.payload) for packet in observed[2].inbox] == [(1, b"up")]
    assert [packet.payload for packet in observed[0].inbox] == [b"down"]
    assert [packet.payload for packet in observed[1].inbox] == [b"down", b"you"]


def test_coverage_metrics_agree_with_counting_and_with_the_area_of_discs() -> None:
    world = world_at((0.5, 0.5, 0.0), (0.8, 0.8, 0.0), (3.5, 3.5, 0.0))
    counts = cell_counts(world.scene.position, world.scene.arena.bounds, (4, 2))
    assert counts.tolist() == [[2, 0, 0, 0], [0, 0, 0, 1]]
    assert cell_coverage_fraction(counts) == 0.25
    quarter = area_coverage_fraction(np.array([[0.0, 0.0]]), 1.0, world.scene.arena)
    assert quarter == pytest.approx(math.pi / 4 / 16, rel=1e-3)
    twice = area_coverage_fraction(np.array([[2.0, 2.0], [2.0, 2.0]]), 1.0, world.scene.arena)
    assert twice == pytest.approx(math.pi / 16, rel=1e-3)


def test_the_corners_of_the_arena_belong_to_the_outer_cells() -> None:
    counts = cell_counts(np.array([[0.0, 0.0], [4.0, 4.0]]), (0.0, 0.0, 4.0, 4.0), (2, 2))
    assert counts.tolist() == [[1, 0], [0, 1]]
