"""Telemetry of a run: named numbers and snapshots that nodes report for observers of the run. No node receives them.

Memory is bounded. Numbers are stored as columns, at most `NUMBERS_MAX` of them (`NUMBER_BYTES` each). Snapshots are
stored as bytes with references to the position arrays of their tick, at most `SNAPSHOT_BYTES_MAX` bytes. Beyond a
bound, or beyond `DISTINCT_NAMES_MAX` names in one run, a record is counted in `dropped` and not kept. The newest value
of each known name of each node, and what listeners of the sink compute, do not depend on the first two bounds.
"""

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from zwerm.wire.messages import Command
from zwerm.world.scene import Bools, Floats, Ints, Scene

NUMBERS_MAX: Final = 2_000_000  # 44 MB
NUMBER_BYTES: Final = 22  # tick, node, name and value
SNAPSHOT_BYTES_MAX: Final = 64 * 2**20
DISTINCT_NAMES_MAX: Final = 1_024
PREFIX: Final = "telemetry."
DROPPED: Final = "telemetry_dropped"


class TelemetryRecord(NamedTuple):
    """The report of one command of a node, and the true state at that tick. The arrays must not be changed.

    `down` are the nodes whose programs did not run then, ascending.
    """

    tick: int
    time_s: float
    node: int
    numbers: Mapping[str, float]
    snapshot: bytes
    position: Floats  # (n, 2) [m]
    present: Bools  # (n,)
    down: Sequence[int] = ()


@dataclass(frozen=True, slots=True, eq=False)
class TelemetryArrays:
    """The telemetry numbers of a run as parallel arrays of k records, in the order of the run."""

    tick: Ints  # (k,)
    time_s: Floats  # (k,) [s]
    node: Ints  # (k,)
    name: NDArray[np.str_]  # (k,)
    value: Floats  # (k,)

    @classmethod
    def empty(cls) -> Self:
        """Return the telemetry of a run without any."""
        none = np.zeros(0, dtype=np.int64)
        return cls(none, np.zeros(0), none, np.zeros(0, dtype="<U1"), np.zeros(0))

    def __len__(self) -> int:
        return len(self.tick)

    def of(self, name: str, node: int | None = None) -> tuple[Floats, Floats]:
        """Return the times [s] and the values of one name, of one node or of all nodes."""
        chosen = self.name == name
        if node is not None:
            chosen &= self.node == node
        return self.time_s[chosen], self.value[chosen]


class TelemetrySink:
    """Takes the telemetry of commands."""

    def __init__(self, dt_s: float = 1.0, numbers_max: int = NUMBERS_MAX, bytes_max: int = SNAPSHOT_BYTES_MAX) -> None:
        self.dropped = 0
        self.newest: dict[int, dict[str, float]] = {}  # by node, then by name
        self.snapshots: list[TelemetryRecord] = []
        self.listeners: list[Callable[[TelemetryRecord], object]] = []
        self._dt_s = dt_s
        self._numbers_max = numbers_max
        self._bytes_max = bytes_max
        self._bytes = 0
        self._arrays_tick = -1
        self._names: dict[str, int] = {}
        self._tick, self._node, self._name, self._value = array("q"), array("i"), array("h"), array("d")

    def accept(self, scene: Scene, node: int, command: Command, down: Bools | None = None) -> None:
        """Take the telemetry and the snapshot of a command; `down` (nodes,) is true for nodes without a running program."""
        if not command.telemetry and not command.snapshot:
            return
        numbers = {name: float(value) for name, value in command.telemetry.items()}
        record = TelemetryRecord(
            *(scene.tick, scene.time_s, node, numbers, command.snapshot, scene.position, scene.present),
            () if down is None else np.flatnonzero(down).tolist(),
        )
        if numbers:
            self._keep_numbers(scene.tick, node, numbers)
        if command.snapshot:
            self._keep_snapshot(record)
        for listener in self.listeners:
            listener(record)

    def arrays(self) -> TelemetryArrays:
        """Return all numbers that were kept."""
        names = np.array(list(self._names), dtype=np.str_) if self._names else np.zeros(0, dtype="<U1")
        tick = np.array(self._tick, dtype=np.int64)
        name = np.array(self._name, dtype=np.int64)
        node, value = np.array(self._node, dtype=np.int64), np.array(self._value, dtype=np.float64)
        time_s = np.multiply(tick, self._dt_s, dtype=np.float64)
        return TelemetryArrays(tick, time_s, node, names[name], value)

    def metrics(self) -> dict[str, float]:
        """Return `telemetry.<name>`, the mean over nodes of each node's newest value; and the records dropped, if any."""
        newest: dict[str, list[float]] = {name: [] for name in self._names}
        for _, numbers in sorted(self.newest.items()):
            for name, value in numbers.items():
                newest[name].append(value)
        found = {PREFIX + name: float(np.mean(values)) for name, values in newest.items()}
        return found | {DROPPED: float(self.dropped)} if self.dropped else found

    def _keep_numbers(self, tick: int, node: int, numbers: Mapping[str, float]) -> None:
        newest, names = self.newest.setdefault(node, {}), self._names
        for name, value in numbers.items():
            index = names.get(name)
            if index is None:
                if len(names) >= DISTINCT_NAMES_MAX:
                    self.dropped += 1
                    continue
                index = names[name] = len(names)
            newest[name] = value
            if len(self._tick) >= self._numbers_max:
                self.dropped += 1
                continue
            self._tick.append(tick)
            self._node.append(node)
            self._name.append(index)
            self._value.append(value)

    def _keep_snapshot(self, record: TelemetryRecord) -> None:
        size = len(record.snapshot)
        if record.tick != self._arrays_tick:
            size += record.position.nbytes + record.present.nbytes
        if self._bytes + size > self._bytes_max:
            self.dropped += 1
            return
        self._bytes += size
        self._arrays_tick = record.tick
        self.snapshots.append(record._replace(numbers={}))
