"""Other tools can read a recording message by message, and recording changes no run."""

import contextlib
import json
from pathlib import Path

import msgpack
import pytest
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import make_reader
from mcap.records import McapRecord, Message
from mcap.stream_reader import StreamReader
from support import scenario

from zwerm.errors import ScenarioError
from zwerm.record.recording import Recording
from zwerm.run.assembly import assemble
from zwerm.run.runner import run


def test_a_recording_holds_every_message_as_it_crossed_the_wire_and_the_truth(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorded = run(scenario(), 1, "inline", record=path)
    assert recorded.trace == run(scenario(), 1, "inline").trace
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = [(channel.topic, message) for _, channel, message in reader.iter_messages()]
        [about] = [each.metadata for each in reader.iter_metadata() if each.name == "run"]
    assert about["seed"] == "1"
    assert json.loads(about["scenario"])["name"] == "small"
    topics = {f"/node/{node}/{end}" for node in range(4) for end in ("obs", "cmd")} | {"/truth/poses"}
    assert {topic for topic, _ in messages} == topics
    assert len(messages) == 20 * 9
    observed = [msgpack.unpackb(message.data) for topic, message in messages if topic == "/node/2/obs"]
    assert [each["tick"] for each in observed] == list(range(20))
    assert observed[0]["type"] == "observation/1"
    assert isinstance(observed[0]["line_of_sight"], bool)
    poses = [(message.log_time, json.loads(message.data)) for topic, message in messages if topic == "/truth/poses"]
    assert poses[5][0] == 500_000_000
    assert poses[5][1]["id"] == [0, 1, 2, 3]
    assert poses[5][1]["x_m"] == recorded.history.arrays().position[5, :, 0].tolist()


def test_a_recording_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ScenarioError, match=r"cannot write a recording: (File exists|Not a directory)$"):
        run(scenario(), 1, "inline", record=tmp_path / "file" / "run.mcap")


def test_a_recording_that_is_never_closed_holds_all_but_the_last_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = [100.0]
    monkeypatch.setattr("zwerm.record.recording.time.monotonic", lambda: clock[0])
    path, world = tmp_path / "run.mcap", assemble(scenario(), 1)
    recording = Recording(path, 0.1, {})
    written_s: list[float] = []
    for tick in range(100):
        clock[0] += 0.07 if tick != 50 else 3.0  # a pause: nothing is written meanwhile
        recording.exchange(tick, [0], [b"observation"], [b"command"], world.scene)
        written_s.append(clock[0])
        on_disk = [each.sequence for each in readable(path) if isinstance(each, Message)]
        missing = set(range(tick + 1)) - set(on_disk)
        assert all(clock[0] - written_s[each] < 1.0 for each in missing), (tick, missing)
    recording.close()
    assert len({each.sequence for each in readable(path) if isinstance(each, Message)}) == 100


def readable(path: Path) -> list[McapRecord]:
    """Return the records of a file that may end anywhere."""
    found: list[McapRecord] = []
    with path.open("rb") as file, contextlib.suppress(EndOfFile, McapError):
        for record in StreamReader(file).records:
            found.append(record)  # noqa: PERF402 - keep what was read before the end
    return found


def test_two_recordings_at_once_never_share_a_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    expected = r"run.mcap: cannot write a recording: another run is writing to it$"
    with Recording(path, 0.1, {}), pytest.raises(ScenarioError, match=expected):
        Recording(path, 0.1, {})
    whole = path.read_bytes()
    with Recording(path, 0.1, {}):
        pass
    assert path.read_bytes() == whole, "the next run replaces the file"
