"""Ctrl-C at any moment of a wait of the world's link: the link still receives, and closes."""

import contextlib
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from network import network
from waiting import until

from zwerm.link.arrival_signal import ArrivalSignal
from zwerm.link.world_link import ZenohWorldLink

Wait = Callable[[ZenohWorldLink], object]


def interrupt_at(moment: int, call: Callable[[], object]) -> bool:
    """Call with a KeyboardInterrupt at the `moment`th entry to or exit from a Python function; return whether it came.

    Python handles signals there, among other places.
    """
    passed = 0

    def trace(_: FrameType, event: str, __: Any) -> Any:
        nonlocal passed
        if event in ("call", "return"):
            passed += 1
            if passed == moment:
                raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        call()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


def evict(link: ZenohWorldLink, free: threading.Event) -> None:
    """Take and release the lock of the link."""
    link.evict(2)
    free.set()


@pytest.mark.parametrize(
    "wait",
    [lambda link: link.receive(0.001), lambda link: link.wait_joined(lambda joined: len(joined) > 1, 0.001)],
    ids=["receive", "wait_joined"],
)
def test_an_interrupt_at_any_moment_of_a_wait_does_not_block_the_threads_that_receive(
    private_tmp: Path, wait: Wait
) -> None:
    with network(private_tmp) as net, contextlib.closing(net.node(0)) as node:
        node.join()
        moment = 0
        came = True
        while came:
            moment += 1
            came = interrupt_at(moment, lambda: wait(net.link))
            free = threading.Event()
            threading.Thread(target=evict, args=(net.link, free), daemon=True).start()
            until(free.is_set, f"another thread can use the link after an interrupt at moment {moment}")
            node.send(b"after")
            arrival = net.link.receive(20.0)
            assert arrival is not None, moment
            assert arrival.payload == b"after"
        assert moment > 5, "the interrupts came inside the wait"


def test_a_wait_may_have_any_time_limit() -> None:
    signal = ArrivalSignal()
    answers = iter([False, True])

    def condition() -> bool:
        signal.notify()
        return next(answers)

    assert signal.wait_for(condition, 1e300)
