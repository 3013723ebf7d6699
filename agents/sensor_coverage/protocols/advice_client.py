"""What a robot tells a coordinator that finds who can be spared, and what it is told: the robot's end of the uplink.

It says how it stands once that has been the same for a while, and again, less and less often, until that was noted. A
coordinator that begins anew asks. While none answers, nobody is spared, and nothing else is different.

What makes it safe that a robot leaves upon somebody else's word. The criterion by which b0 and b1 stay as they are speaks of
the lists of its neighbours and of nothing else; a verdict names the version of each list for which the coordinator found that
it holds. The robot asks those neighbours for the same locks as if it had found so by itself (`redundancy`), with the same
versions, and a neighbour whose list is of another version, or who is missing in the verdict, prevents it. To neighbours that
is one and the same question, whoever thought of it: what was explored for robots that know old lists of each neighbour holds
for verdicts from old lists. So lost, late, repeated or wrong words of the uplink, and a coordinator that dies, forgets, or
overlooks a push, cost time; what they cannot do is open a hole.
"""

from collections.abc import Iterable
from typing import Final

import msgspec

from zwerm.agents.sensor_coverage.messages.advice import (
    CollectReports,
    RedundantAdvice,
    ReportNoted,
    StandingReport,
    read,
    write,
)

# How long it has to stand as it does before it says so, and how soon it says so again, at first and at most [ticks].
SETTLED_TICKS: Final = 5
AGAIN_TICKS: Final = 4
AGAIN_TICKS_MAX: Final = 160
# For how long it believes that it can be spared [ticks].
BELIEVED_TICKS: Final = 120
# What is new is numbered by the robot's clock in these units at least: one that lost its memory repeats no number.
TICKS_PER_S: Final = 1_000


class AdviceClient:
    """One robot's part. `note` comes in every tick that it is awake in, before what is sent is taken."""

    def __init__(self, dt_s: float) -> None:
        self._dt_s = dt_s
        self._tick = 0
        self._number = 0
        self._newest: StandingReport | None = None  # its number is given when it is told
        self._since = 0
        self._told: StandingReport | None = None
        self._again_at: int | None = None
        self._wait_ticks = AGAIN_TICKS
        self._verdict: tuple[tuple[int, int], ...] | None = None
        self._verdict_until = 0

    def note(self, tick: int, standing: StandingReport | None) -> None:
        """Take in how the robot stands; None while that means nothing. The number is left to this."""
        self._tick = tick
        if standing != self._newest:
            self._newest, self._since = standing, tick
        if standing is None or tick < self._since + SETTLED_TICKS:
            return
        if not self._known:
            self._number = max(self._number + 1, round(tick * self._dt_s * TICKS_PER_S))
            self._told = msgspec.structs.replace(standing, number=self._number)
            self._tell_now()

    def hear(self, tick: int, payload: bytes) -> None:
        """Take in a packet of the uplink."""
        match read(payload):
            case ReportNoted(number):
                if self._told is not None and number == self._told.number:
                    self._again_at = None
            case CollectReports():
                self._tick = tick
                if self._told is not None:
                    self._tell_now()
            case RedundantAdvice(versions):
                self._verdict, self._verdict_until = versions, tick + BELIEVED_TICKS

    def verdict(self, tick: int, listed: Iterable[int]) -> tuple[tuple[int, int], ...] | None:
        """Return the versions of the neighbours' lists by which a robot that sees these can be spared, if it was told so."""
        said = self._verdict
        if said is None or tick >= self._verdict_until or tuple(node for node, _ in said) != tuple(listed):
            return None
        return said

    def letters(self) -> list[bytes]:
        """Return what is to be sent now."""
        if self._told is None or self._again_at is None or self._tick < self._again_at or not self._known:
            return []
        self._again_at = self._tick + self._wait_ticks
        self._wait_ticks = min(2 * self._wait_ticks, AGAIN_TICKS_MAX)
        return [write(self._told)]

    def next_ticks(self) -> list[int]:
        """Return when to be looked after, at the latest."""
        if not self._known:
            return [] if self._newest is None else [self._since + SETTLED_TICKS]
        return [] if self._again_at is None else [self._again_at]

    @property
    def _known(self) -> bool:
        """Whether the robot stands as it said last."""
        newest, told = self._newest, self._told
        return newest is not None and told is not None and newest == msgspec.structs.replace(told, number=newest.number)

    def _tell_now(self) -> None:
        self._again_at, self._wait_ticks = self._tick, AGAIN_TICKS
