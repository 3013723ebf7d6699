"""Run a scenario in real time with its packets on a real network.

Observations and commands go over a Unix socket that loses nothing. Packets between nodes go over the network, and nodes
receive only the packets that arrive there. The world gets a copy of each packet sent, and its models decide about it.
So each packet has a modelled and a real result, at the same tick and the same positions.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from zwerm.deploy.network.impairments import Impairments, Network, translate
from zwerm.deploy.network.namespaces import Namespaces, address_of, unavailable_reason
from zwerm.deploy.node_specs import node_specs
from zwerm.deploy.runtime_directory import private_directory
from zwerm.deploy.swarm import LocalSwarm, Members
from zwerm.errors import LinkError
from zwerm.link.peer_radio import MET, LogLine, Station, Transport, read_log
from zwerm.run.assembly import assemble
from zwerm.run.progress import NullProgress, ProgressListener
from zwerm.run.runner import new_run_id
from zwerm.scenario.tables import Scenario
from zwerm.world.drivers.realtime import RealTime
from zwerm.world.radio import ROBOTS
from zwerm.world.tick.completion import COMPLETED, INTERRUPTED, TIME_LIMIT
from zwerm.world.world import World

MEET_DEADLINE_S: Final = 30.0
_POLL_S: Final = 0.02

# Seconds that nodes listen after the last tick: TCP may wait seconds before it retransmits.
DRAIN_S: Final[dict[Transport, float]] = {"udp": 0.5, "tcp": 3.0}


@dataclass(slots=True)
class TwinRun:
    """One run: the world with its ledgers, the log of each node's radio, and the counters of the network."""

    world: World
    transport: Transport
    outcome: str
    reason: str
    wall_s: float
    middleware_lost: int
    channels: tuple[str, ...]
    links: dict[str, list[tuple[int, int]]]
    impairments: Impairments
    logs: dict[int, list[LogLine]]
    network_dropped: dict[str, int]  # IP packets, by rule
    retransmitted: int  # TCP segments
    segments: int


def require_namespaces() -> None:
    """Raise LinkError, with the reason, if this machine cannot create network namespaces."""
    reason = unavailable_reason()
    if reason:
        raise LinkError(f"the twin on a real network {reason}")


def run_twin(scenario: Scenario, seed: int, transport: Transport, listener: ProgressListener | None = None) -> TwinRun:
    """Run a scenario that `supported` returned, with its packets on a network of its own.

    Raises LinkError if this machine cannot create network namespaces, and ScenarioError for an error in the scenario.
    """
    require_namespaces()
    listener = listener or NullProgress()
    world = assemble(scenario, seed)
    links = {name: channel.pairs() for name, channel in world.medium.channels.items()}
    impairments = translate(scenario, links)
    members = node_specs(scenario, seed)
    with (
        Namespaces(sorted(members)) as namespaces,
        private_directory() as directory,
    ):
        stations = _stations(scenario, members, namespaces, transport, directory)
        logs = {node: Path(station.log) for node, station in stations.items()}
        with LocalSwarm(new_run_id(), members, progress=listener.joined, paced=True, stations=stations) as swarm:
            _wait_until_connected(logs)
            network = Network(namespaces, impairments, transport)
            network.impair(world.scene.draws)
            driver = _driver(world, swarm, network, impairments, listener)
            before, start = _segments(namespaces, members), time.monotonic()
            try:
                outcome, reason = driver.run(), driver.reason
            except KeyboardInterrupt:
                outcome, reason = INTERRUPTED, f"interrupted at tick {world.tick}"
            wall_s = time.monotonic() - start
            if outcome in (COMPLETED, TIME_LIMIT):
                time.sleep(DRAIN_S[transport])
            lines = {node: list(read_log(path)) for node, path in logs.items()}
            dropped = network.dropped()
            segments, again = (late - early for late, early in zip(_segments(namespaces, members), before, strict=True))
    return TwinRun(
        world=world,
        transport=transport,
        outcome=outcome,
        reason=reason,
        wall_s=wall_s,
        middleware_lost=driver.lost,
        channels=tuple(links),
        links=links,
        impairments=impairments,
        logs=lines,
        network_dropped=dropped,
        retransmitted=again,
        segments=segments,
    )


def _driver(
    world: World, swarm: LocalSwarm, network: Network, impairments: Impairments, listener: ProgressListener
) -> RealTime:
    """Return the real-time driver of the world; it updates the network's blocked pairs at every tick."""
    table = world.scenario.time
    ticks = round(table.duration_s / table.dt_s)

    def block_stopped(world: World) -> None:
        pairs = [
            pair
            for name in world.medium.channels
            for pair in world.medium.stopped(name, world.scene, impairments.by_place.get(name, ()))
        ]
        network.block(pairs)

    def report(world: World) -> None:
        listener.ticked(world.tick, ticks)

    return RealTime(world, swarm.link, 1.0, [report], swarm, block_stopped)


def _stations(
    scenario: Scenario, members: Members, namespaces: Namespaces, transport: Transport, directory: Path
) -> dict[int, Station]:
    """Return each node's station. Robots receive from robots; the coordinator and all other nodes from each other."""
    addresses = {node: address_of(node) for node in members}
    coordinator = scenario.robots.count if scenario.coordinator is not None else None
    channels: dict[str, bool] = {}
    if scenario.radio is not None:
        channels["robots"] = scenario.radio.anonymous
    if coordinator is not None:
        channels["uplink"] = scenario.uplink is not None and scenario.uplink.anonymous

    def senders_of(node: int) -> list[tuple[str, str]]:
        found = []
        if scenario.radio is not None and node != coordinator:
            found.append((ROBOTS, "*"))
        if coordinator is not None:
            found.append(("uplink", "*" if node == coordinator else str(coordinator)))
        return found

    return {
        node: Station(
            node=node,
            namespace=namespaces.path(node),
            transport=transport,
            addresses=addresses,
            channels=tuple(channels),
            receives_from=tuple(senders_of(node)),
            anonymous=tuple(name for name, anonymous in channels.items() if anonymous),
            log=str(directory / f"radio-{node}"),
        )
        for node in members
    }


def _wait_until_connected(logs: dict[int, Path]) -> None:
    """Wait until each pair of nodes has exchanged hellos. Raises LinkError after MEET_DEADLINE_S."""
    end_s = time.monotonic() + MEET_DEADLINE_S
    waiting = list(logs)
    while waiting := [node for node in waiting if not any(line.what == MET for line in read_log(logs[node]))]:
        if time.monotonic() > end_s:
            raise LinkError(
                f"the twin on a real network: node {min(waiting)} has not met all others within {MEET_DEADLINE_S:g} s"
            )
        time.sleep(_POLL_S)


def _segments(namespaces: Namespaces, members: Members) -> tuple[int, int]:
    """Return the numbers of TCP segments sent and retransmitted by all nodes so far."""
    sent = again = 0
    for node in members:
        lines = [line.split() for line in namespaces.run(["cat", "/proc/net/snmp"], node=node).splitlines()]
        names, values = (line for line in lines if line[0] == "Tcp:")
        counts = dict(zip(names, values, strict=True))
        sent += int(counts["OutSegs"])
        again += int(counts["RetransSegs"])
    return sent, again
