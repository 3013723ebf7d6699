"""The log of broadcasts, where robots come and go often."""

import numpy as np
import pytest

from zwerm.world.radio import broadcast_log
from zwerm.world.radio.broadcast_log import BroadcastLog

NODES = 6
CHANGES = 500


@pytest.mark.parametrize("periods_max", [0, 10_000])
def test_packets_are_counted_alike_however_often_nodes_come_and_go_and_memory_is_bounded(
    periods_max: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(broadcast_log, "_PERIODS_MAX", periods_max)
    random = np.random.Generator(np.random.Philox(1))
    log = BroadcastLog(range(NODES), NODES)
    expected = np.zeros((3, NODES, NODES), dtype=np.int64)  # absent, off, beyond
    for _ in range(CHANGES):
        present, off = random.random(NODES - 1) < 0.7, random.random(NODES) < 0.3
        there = np.append(present, True)
        senders = random.integers(0, NODES - 2, 3)  # one node never sends
        log.add(senders, present, off)
        for sender in senders.tolist():
            expected[:, sender] += [~there, there & off, there & ~off]
    none = np.zeros(0, dtype=np.int64)
    found = log.unshown(none, none, none)
    got = np.zeros_like(expected)
    got[:, found.sender, found.receiver] = [found.absent, found.off, found.beyond]
    expected[:, range(NODES), range(NODES)] = 0
    assert (got == expected).all()
    assert log.senders().tolist() == list(range(NODES - 2))
    assert log.unshown(none, none, none).off.tolist() == found.off.tolist(), "asking changes nothing"
    assert len(log._periods) <= max(periods_max, NODES)
