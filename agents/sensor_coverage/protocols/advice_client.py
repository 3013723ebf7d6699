"""A robot's end of the uplink to a coordinator that finds redundant robots.

The robot reports its part of the complex once this part has been the same for some time. It repeats the report, less
and less often, until the coordinator acknowledges it. A coordinator that starts again asks for reports. While no
coordinator answers, no robot leaves, and nothing else changes.

It is safe that a robot leaves on advice. The criterion by which b0 and b1 stay the same depends only on the lists of
the robot's neighbours. Advice names the version of each list for which the coordinator found that the criterion holds.
The robot requests the same locks as if it had found that itself (`leave_lock`), with these versions. A neighbour
prevents the departure if its list has another version, or if the advice does not name it. So lost, late, repeated or
wrong advice costs time and cannot open a hole. The same holds for a coordinator that dies, loses its memory, or misses
a push.
"""

from collections.abc import Iterable
from typing import ClassVar, Final

import msgspec

from zwerm.agents.sensor_coverage.messages.advice import (
    CHANNEL,
    CollectReports,
    RedundantAdvice,
    ReportNoted,
    StandingReport,
)
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing

# Ticks for which a report must stay the same before it is sent, and ticks between repetitions, at first and at most.
SETTLED_TICKS: Final = 5
REPEAT_TICKS: Final = 4
REPEAT_TICKS_MAX: Final = 160
# Ticks for which advice holds.
ADVICE_TICKS: Final = 120
# Report numbers are never below the robot's clock in these units, so that a robot that lost its memory repeats none.
TICKS_PER_S: Final = 1_000


class AdviceClient(Component):
    """One robot's part. `update` comes in every tick in which the robot is awake, before `outgoing`."""

    channel: ClassVar[str] = CHANNEL
    accepts: ClassVar[tuple[type, ...]] = (ReportNoted, CollectReports, RedundantAdvice)

    def __init__(self, dt_s: float) -> None:
        self._dt_s = dt_s
        self._tick = 0
        self._number = 0
        self._newest: StandingReport | None = None  # its number is set when it is sent
        self._since = 0
        self._sent: StandingReport | None = None
        self._due: int | None = None
        self._wait_ticks = REPEAT_TICKS
        self._advice: tuple[tuple[int, int], ...] | None = None
        self._advice_until = 0

    def update(self, tick: int, standing: StandingReport | None) -> None:
        """Take in the robot's report, with any number; None while the robot does not know."""
        self._tick = tick
        if standing != self._newest:
            self._newest, self._since = standing, tick
        if standing is None or tick < self._since + SETTLED_TICKS:
            return
        if not self._current:
            self._number = max(self._number + 1, round(tick * self._dt_s * TICKS_PER_S))
            self._sent = msgspec.structs.replace(standing, number=self._number)
            self._send_now()

    def receive(self, sender: int, message: ReportNoted | CollectReports | RedundantAdvice, tick: int) -> None:
        """Take in a message of the coordinator."""
        match message:
            case ReportNoted(number):
                if self._sent is not None and number == self._sent.number:
                    self._due = None
            case CollectReports():
                self._tick = tick
                if self._sent is not None:
                    self._send_now()
            case RedundantAdvice(versions):
                self._advice, self._advice_until = versions, tick + ADVICE_TICKS

    def advice(self, tick: int, listed: Iterable[int]) -> tuple[tuple[int, int], ...] | None:
        """Return the list versions under which a robot that sees `listed` is redundant, or None without valid advice."""
        advice = self._advice
        if advice is None or tick >= self._advice_until or tuple(node for node, _ in advice) != tuple(listed):
            return None
        return advice

    def outgoing(self) -> list[Outgoing]:
        """Return the report if it is due."""
        if self._sent is None or self._due is None or self._tick < self._due or not self._current:
            return []
        self._due = self._tick + self._wait_ticks
        self._wait_ticks = min(2 * self._wait_ticks, REPEAT_TICKS_MAX)
        return [Outgoing(None, self._sent)]

    def next_wake(self) -> int | None:
        """Return the tick at which the report settles or is repeated."""
        if not self._current:
            return None if self._newest is None else self._since + SETTLED_TICKS
        return self._due

    @property
    def _current(self) -> bool:
        """True if the report that was sent last still holds."""
        newest, sent = self._newest, self._sent
        return newest is not None and sent is not None and newest == msgspec.structs.replace(sent, number=newest.number)

    def _send_now(self) -> None:
        self._due, self._wait_ticks = self._tick, REPEAT_TICKS
