"""Tasks from the coordinator: a frontier and the path there, cut into parts that fit into a packet and joined again.

    frontier <a, b>     2 bytes a landmark; 0, 0: halt, that is stand still and add nothing to the map; 1, 1: random walk
    status              1 byte: the status of the frontier after a time-out
    vertices            for each: the number of its landmarks (1 byte), then landmark and bearing of each (2 bytes and 1 byte)

The coordinator sends a task again if the robot's report shows that it lacks the task. The robot keeps the parts that it has.
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

# Bytes of a packet beside the part of a task: the checksum, the tag and the numbers.
_AROUND_BYTES: Final = 30

_PARTS_MAX: Final = 1 << 12
_LANDMARKS_MAX: Final = 255


class ExplorationTask(NamedTuple):
    """The task of a robot: follow `path`, explore the frontier `key`, and set its status to `status` after a time-out.

    Without a frontier the robot halts, or with `walk` does a random walk, because no path leads to an open frontier.
    """

    key: int | None
    path: tuple[BearingSnapshot, ...] = ()
    status: int = TIMED_OUT
    walk: bool = False


def write_task(task: ExplorationTask) -> bytes:
    """Return a task as bytes."""
    a, b = (int(task.walk), int(task.walk)) if task.key is None else pair_of(task.key)
    content = [pack(_HEAD, a, b, task.status)]
    for landmarks, bearings in task.path:
        pairs = list(zip(landmarks, bearings, strict=True))[:_LANDMARKS_MAX]
        content.append(bytes([len(pairs)]) + b"".join(pack("<HB", *each) for each in pairs))
    return b"".join(content)


def read_task(content: bytes) -> ExplorationTask:
    """Return the task that `content` encodes. Raises ValueError where it encodes none."""
    if len(content) < _HEAD_BYTES:
        raise ValueError(f"a task takes at least {_HEAD_BYTES} bytes, got {len(content)}")
    a, b, status = unpack_from(_HEAD, content)
    path, at = [], _HEAD_BYTES
    while at < len(content):
        end = at + 1 + 3 * content[at]
        if end > len(content):
            raise ValueError("a vertex of the path is cut off")
        path.append(snapshot_of(iter_unpack("<HB", content[at + 1 : end])))
        at = end
    return ExplorationTask(None if a == b else a << 16 | b, tuple(path), status, walk=a == b == 1)


def cut(
    content: bytes, coordinator_incarnation: int, incarnation: int, task_number: int, bytes_max: int
) -> list[TaskPart]:
    """Return an encoded task in parts that fit into packets of `bytes_max`."""
    size = bytes_max - _AROUND_BYTES
    parts = [content[start : start + size] for start in range(0, len(content), size)]
    return [
        TaskPart(coordinator_incarnation, incarnation, task_number, number, len(parts), part)
        for number, part in enumerate(parts)
    ]


class TaskIntake:
    """Joins the parts of tasks. `newest` is the (coordinator incarnation, task number) of the last complete task."""

    def __init__(self, incarnation: int) -> None:
        self.newest = (0, 0)
        self._incarnation = incarnation
        self._coming = (0, 0)
        self._parts: dict[int, bytes] = {}

    def accept(self, part: TaskPart) -> ExplorationTask | None:
        """Store a part. Return its task if that is now complete and newer than all before, else None."""
        number = part.coordinator_incarnation, part.task_number
        if part.incarnation != self._incarnation or number <= self.newest or number < self._coming:
            return None
        if not 0 <= part.part < part.parts <= _PARTS_MAX:
            return None
        if number > self._coming:
            self._coming, self._parts = number, {}
        self._parts[part.part] = part.bytes_
        if len(self._parts) < part.parts:
            return None
        self.newest = number
        content = b"".join(each for _, each in sorted(self._parts.items()))
        self._parts = {}
        try:
            return read_task(content)
        except ValueError:
            return None


def landmark_bytes(landmarks: Sequence[int], most: int = 12) -> bytes:
    """Return the ids of up to `most` landmarks, 2 bytes each."""
    return b"".join(pack("<H", each) for each in landmarks[:most])


def landmarks_in(content: bytes) -> tuple[int, ...]:
    """Return the ids of landmarks that `content` encodes, ascending. Raises ValueError for an odd number of bytes."""
    if len(content) % 2:
        raise ValueError("2 bytes a landmark")
    return tuple(sorted({each for (each,) in iter_unpack("<H", content)}))
