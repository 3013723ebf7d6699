"""Orders of the coordinator: a frontier and the way there, cut into parts that fit into a packet and put together again.

    frontier <a, b>     2 bytes a landmark; 0, 0: halt, that is stand still and add nothing to the map; 1, 1: walk about
    status              1 byte: what the frontier becomes if the robot's time there runs out
    vertices            for each: the number of its landmarks (1 byte), then landmark and bearing of each (2 bytes and 1 byte)

An order is said again whenever the robot's report shows that it has not got it; it keeps the parts that it has.
"""

from collections.abc import Sequence
from struct import iter_unpack, pack, unpack_from
from typing import Final, NamedTuple

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.frontier_status import TIMED_OUT, pair_of
from zwerm.agents.landmark_exploration.sharing.landmark_messages import TaskPart
from zwerm.agents.landmark_exploration.sharing.log_entries import snapshot_of

_HEAD: Final = "<HHB"
_HEAD_BYTES: Final = 5

# Bytes of a packet that are no part of what an order says: the checksum, the tag and the numbers.
_AROUND_BYTES: Final = 30

_PARTS_MAX: Final = 1 << 12
_LANDMARKS_MAX: Final = 255


class ExplorationTask(NamedTuple):
    """The task of a robot: explore the frontier `key` by way of `path`, and give it `status` if the time runs out.

    Without a frontier it halts, or walks about where it is cut off from all that is to be explored.
    """

    key: int | None
    path: tuple[BearingSnapshot, ...] = ()
    status: int = TIMED_OUT
    walk: bool = False


def write_task(task: ExplorationTask) -> bytes:
    """Return a task as bytes."""
    a, b = (int(task.walk), int(task.walk)) if task.key is None else pair_of(task.key)
    said = [pack(_HEAD, a, b, task.status)]
    for landmarks, bearings in task.path:
        pairs = list(zip(landmarks, bearings, strict=True))[:_LANDMARKS_MAX]
        said.append(bytes([len(pairs)]) + b"".join(pack("<HB", *each) for each in pairs))
    return b"".join(said)


def read_task(said: bytes) -> ExplorationTask:
    """Return the task that bytes say. Raises ValueError where they say none."""
    if len(said) < _HEAD_BYTES:
        raise ValueError(f"a task takes at least {_HEAD_BYTES} bytes, got {len(said)}")
    a, b, status = unpack_from(_HEAD, said)
    path, at = [], _HEAD_BYTES
    while at < len(said):
        end = at + 1 + 3 * said[at]
        if end > len(said):
            raise ValueError("a vertex of the path is cut off")
        path.append(snapshot_of(iter_unpack("<HB", said[at + 1 : end])))
        at = end
    return ExplorationTask(None if a == b else a << 16 | b, tuple(path), status, walk=a == b == 1)


def cut(said: bytes, coordinator_incarnation: int, incarnation: int, order: int, bytes_max: int) -> list[TaskPart]:
    """Return what an order says in parts that fit into packets of `bytes_max`."""
    size = bytes_max - _AROUND_BYTES
    parts = [said[start : start + size] for start in range(0, len(said), size)]
    return [
        TaskPart(coordinator_incarnation, incarnation, order, number, len(parts), part)
        for number, part in enumerate(parts)
    ]


class OrderIntake:
    """Puts orders together. `newest` is the (incarnation, number) of the last one that is complete."""

    def __init__(self, incarnation: int) -> None:
        self.newest = (0, 0)
        self._incarnation = incarnation
        self._coming = (0, 0)
        self._parts: dict[int, bytes] = {}

    def accept(self, order: TaskPart) -> ExplorationTask | None:
        """Take in a part, and return the task that is complete with it, if one is and it is newer than all before."""
        number = order.coordinator_incarnation, order.order
        if order.incarnation != self._incarnation or number <= self.newest or number < self._coming:
            return None
        if not 0 <= order.part < order.parts <= _PARTS_MAX:
            return None
        if number > self._coming:
            self._coming, self._parts = number, {}
        self._parts[order.part] = order.bytes_
        if len(self._parts) < order.parts:
            return None
        self.newest = number
        said = b"".join(part for _, part in sorted(self._parts.items()))
        self._parts = {}
        try:
            return read_task(said)
        except ValueError:
            return None


def landmark_bytes(landmarks: Sequence[int], most: int = 12) -> bytes:
    """Return the ids of up to `most` landmarks, 2 bytes each."""
    return b"".join(pack("<H", each) for each in landmarks[:most])


def landmarks_in(said: bytes) -> tuple[int, ...]:
    """Return the ids of landmarks, ascending. Raises ValueError where bytes say none."""
    if len(said) % 2:
        raise ValueError("2 bytes a landmark")
    return tuple(sorted({each for (each,) in iter_unpack("<H", said)}))
