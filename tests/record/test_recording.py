"""Other tools can read a recording message by message, and recording changes no run."""

import json
from pathlib import Path

import msgpack
import pytest
from mcap.reader import make_reader
from support import scenario

from zwerm.errors import ScenarioError
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
