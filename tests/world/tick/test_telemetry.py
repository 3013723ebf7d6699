"""The sink of telemetry: the records that it keeps, those that it drops, and its largest memory."""

import tracemalloc

import numpy as np
import pytest
from support import scenario

from zwerm.run.assembly import assemble
from zwerm.wire.messages import Command
from zwerm.world.scene import Scene
from zwerm.world.tick import telemetry
from zwerm.world.tick.telemetry import DISTINCT_NAMES_MAX, TelemetrySink


@pytest.fixture
def scene() -> Scene:
    return assemble(scenario(), 1).scene


def at(scene: Scene, tick: int) -> Scene:
    from dataclasses import replace

    return replace(scene, tick=tick, time_s=0.1 * tick, position=scene.position.copy())


def test_numbers_are_kept_as_columns_in_the_order_of_the_run(scene: Scene) -> None:
    sink = TelemetrySink(0.1)
    sink.accept(at(scene, 2), 1, Command(telemetry={"battery": 0.5, "load": 2.0}))
    sink.accept(at(scene, 4), 0, Command(telemetry={"battery": 0.75}))
    found = sink.arrays()
    assert found.tick.tolist() == [2, 2, 4]
    assert found.time_s.tolist() == pytest.approx([0.2, 0.2, 0.4])
    assert found.node.tolist() == [1, 1, 0]
    assert found.name.tolist() == ["battery", "load", "battery"]
    assert found.value.tolist() == [0.5, 2.0, 0.75]
    assert found.of("battery", node=0)[1].tolist() == [0.75]


def test_a_metric_of_telemetry_is_the_mean_over_nodes_of_each_nodes_newest_value(scene: Scene) -> None:
    sink = TelemetrySink()
    for node, value in ((0, 9.0), (0, 1.0), (1, 4.0)):
        sink.accept(scene, node, Command(telemetry={"load": value}))
    assert sink.metrics() == {"telemetry.load": 2.5}
    assert TelemetrySink().metrics() == {}


def test_beyond_its_cap_numbers_are_counted_and_not_kept_but_the_newest_values_are(scene: Scene) -> None:
    sink = TelemetrySink(numbers_max=3)
    for value in range(5):
        sink.accept(scene, 0, Command(telemetry={"load": float(value)}))
    assert sink.arrays().value.tolist() == [0.0, 1.0, 2.0]
    assert sink.metrics() == {"telemetry.load": 4.0, "telemetry_dropped": 2.0}


def test_names_beyond_the_limit_of_a_run_are_dropped(scene: Scene) -> None:
    sink = TelemetrySink()
    for number in range(DISTINCT_NAMES_MAX + 5):
        sink.accept(scene, 0, Command(telemetry={f"n{number}": 1.0}))
    assert sink.dropped == 5
    assert len(sink.metrics()) == DISTINCT_NAMES_MAX + 1


def test_snapshots_share_the_positions_of_their_tick_and_are_bounded_by_their_bytes(scene: Scene) -> None:
    here = at(scene, 1)
    arrays = here.position.nbytes + here.present.nbytes
    sink = TelemetrySink(bytes_max=20 + arrays)
    for node in range(3):
        sink.accept(here, node, Command(snapshot=bytes(10)))
    assert [each.node for each in sink.snapshots] == [0, 1]
    assert all(each.position is here.position for each in sink.snapshots)
    assert sink.dropped == 1


def test_five_robots_over_3000_ticks_stay_within_the_stated_bound_of_memory(scene: Scene) -> None:
    """64 numbers and 10 kB of snapshot at each tick of each robot: 960,000 numbers at 22 bytes, and 64 MiB of snapshots."""
    numbers = {f"n_{index}": float(index) for index in range(64)}
    tracemalloc.start()
    try:
        sink = TelemetrySink(0.1)
        for tick in range(3_000):
            here = at(scene, tick)
            for node in range(5):
                sink.accept(here, node, Command(telemetry=numbers, snapshot=bytes(10_000)))
        held, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(sink.arrays()) == 960_000
    # Arrays grow by an eighth at a time.
    assert held <= 1.2 * (960_000 * telemetry.NUMBER_BYTES + telemetry.SNAPSHOT_BYTES_MAX)
    assert sink.dropped > 0


def test_a_listener_gets_every_record_that_the_sink_drops(scene: Scene) -> None:
    sink = TelemetrySink(numbers_max=0, bytes_max=0)
    received: list[telemetry.TelemetryRecord] = []
    sink.listeners.append(received.append)
    sink.accept(scene, 3, Command(telemetry={"x": True}, snapshot=b"s"))
    sink.accept(scene, 3, Command())
    [record] = received
    assert (record.node, record.numbers, record.snapshot) == (3, {"x": 1.0}, b"s")
    assert sink.dropped == 2


def test_positions_of_a_snapshot_are_those_of_its_tick_after_the_robots_have_moved() -> None:
    world = assemble(scenario(robots={"controller": "reporters:Silent", "sensors": []}), 1)
    before = world.scene.position.copy()
    world.telemetry.accept(world.scene, 0, Command(snapshot=b"s"))
    from zwerm.wire.messages import WheelSpeeds, encode

    for tick in range(3):
        world.observe()
        for node in range(4):
            world.accept(node, encode(Command(tick=tick, drive=WheelSpeeds(0.1, 0.1))))
        world.advance()
    assert not np.array_equal(world.scene.position, before)
    assert np.array_equal(world.telemetry.snapshots[0].position, before)
