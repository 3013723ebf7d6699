"""A recording of a run in MCAP, the log format of robotics (opens in Foxglove, Lichtblick and the `mcap` command).

Topics: `/node/<id>/obs` and `/node/<id>/cmd` carry the messages as they crossed the wire (MessagePack);
`/node/<id>/telemetry` carries the numbers that a node reports (JSON, an object of numbers by name); `/truth/poses`
carries the true positions of the robots (JSON), to which no robot has access. Times are virtual. A recording that is
closed, after Ctrl-C too, is complete and indexed; one cut off by a kill holds all chunks written until then.
"""

import contextlib
import fcntl
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self

from mcap.writer import Writer

from zwerm.errors import ScenarioError
from zwerm.version import __version__
from zwerm.world.scene import Scene
from zwerm.world.tick.telemetry import TelemetryRecord

_POSES_SCHEMA: Final = {
    "title": "Poses",
    "description": "Robots in the arena: parallel arrays of ids, positions [m] and headings [rad].",
    "type": "object",
    "properties": {
        "tick": {"type": "integer"},
        "id": {"type": "array", "items": {"type": "integer"}},
        "x_m": {"type": "array", "items": {"type": "number"}},
        "y_m": {"type": "array", "items": {"type": "number"}},
        "heading_rad": {"type": "array", "items": {"type": "number"}},
    },
}


_TELEMETRY_SCHEMA: Final = {
    "title": "Telemetry",
    "description": "Numbers that a node reports, by name.",
    "type": "object",
    "additionalProperties": {"type": "number"},
}


# A run that is killed leaves a recording of all but the last seconds, at most about this many.
FLUSH_S: Final = 0.5


def _open_alone(path: Path) -> BinaryIO:
    """Open a new file, or an old one as empty. Raises OSError, also where another run is writing to it."""
    file = path.open("ab")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise OSError(0, "another run is writing to it") from None
    except OSError:  # this file system has no locks
        pass
    with contextlib.suppress(OSError):  # a device
        file.truncate(0)
        file.seek(0)
    return file


class Recording:
    """Writes one run to `path`. Raises ScenarioError where that cannot be written."""

    def __init__(self, path: Path, dt_s: float, about: dict[str, str]) -> None:
        self.error = ""  # why the recording is incomplete
        self._path = path
        self._dt_s = dt_s
        self._channels: dict[str, int] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = _open_alone(path)
        except OSError as error:
            raise ScenarioError([f"{path}: cannot write a recording: {error.strerror}"]) from None
        self._flush_s = time.monotonic() + FLUSH_S
        self._writer = Writer(self._file)
        self._writer.start(profile="", library=f"zwerm {__version__}")
        self._writer.add_metadata("run", about)
        schema = self._writer.register_schema("zwerm.Poses", "jsonschema", json.dumps(_POSES_SCHEMA).encode())
        self._poses = self._writer.register_channel("/truth/poses", "json", schema)
        self._telemetry_schema = self._writer.register_schema(
            "zwerm.Telemetry", "jsonschema", json.dumps(_TELEMETRY_SCHEMA).encode()
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def exchange(
        self, tick: int, nodes: Sequence[int], observations: Sequence[bytes], answers: Sequence[bytes], scene: Scene
    ) -> None:
        """Write one tick: the observations sent to `nodes`, their answers (b"" for none), and the positions of all
        robots."""
        robots = scene.present_ids()
        poses = {
            "tick": tick,
            "id": robots.tolist(),
            "x_m": scene.position[robots, 0].tolist(),
            "y_m": scene.position[robots, 1].tolist(),
            "heading_rad": scene.heading[robots].tolist(),
        }
        self._write(self._poses, tick, json.dumps(poses).encode())
        for node, observation, answer in zip(nodes, observations, answers, strict=True):
            self._write(self._channel(f"/node/{node}/obs"), tick, observation)
            if answer:
                self._write(self._channel(f"/node/{node}/cmd"), tick, answer)

    def telemetry(self, record: TelemetryRecord) -> None:
        """Write the numbers that a node reported, if any."""
        if record.numbers:
            channel = self._channel(f"/node/{record.node}/telemetry", "json", self._telemetry_schema)
            self._write(channel, record.tick, json.dumps(record.numbers).encode())

    def close(self) -> None:
        """Write the index and close the file; idempotent."""
        if not self._file.closed:
            try:
                if not self.error:
                    self._writer.finish()  # type: ignore[no-untyped-call]
            except OSError as error:
                self._fail(error)
            with contextlib.suppress(OSError):  # reported already
                self._file.close()

    def _fail(self, error: OSError) -> None:
        """Stop recording; the run goes on without it."""
        self.error = f"{self._path}: the recording is incomplete: {error.strerror}"

    def _channel(self, topic: str, encoding: str = "msgpack", schema: int = 0) -> int:
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, encoding, schema)
        return self._channels[topic]

    def _write(self, channel: int, tick: int, message: bytes) -> None:
        if self.error:
            return
        time_ns = round(tick * self._dt_s * 1e9)
        try:
            self._writer.add_message(channel, time_ns, message, time_ns, sequence=tick)
            # A chunk goes to the disk at the end of a second: a run that is killed leaves all but the last one.
            if time.monotonic() >= self._flush_s:
                self._flush()
        except OSError as error:
            self._fail(error)

    def _flush(self) -> None:
        """Write what has been recorded so far to the file."""
        finish_chunk: Callable[[], None] = getattr(self._writer, "_Writer__finalize_chunk")  # noqa: B009 - it has no public name
        finish_chunk()
        self._file.flush()
        self._flush_s = time.monotonic() + FLUSH_S
