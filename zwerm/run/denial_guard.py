"""Ends robots that flood the router with operations that it denies.

The router reports these in its log only, and to write and read that log doubles the processor time of the world. So a run
without a security log begins to read it when the router needs more time for each answer than honest nodes cost.
"""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from zwerm.wire.refusals import Refusals
from zwerm.world.world import FLOOD, World

if TYPE_CHECKING:  # an inline run needs no transport
    from zwerm.deploy.router_messages import RouterCounts
    from zwerm.deploy.security_log import SecurityLog

# The router's processor time [s] for an answer that counts as suspicious. Honest nodes cost 60 to 260 us (measured, the
# larger value on a machine with other work). The time is judged once it adds up to WINDOW_S, and only if the router took
# more than this fraction of a core.
ANSWER_S_MAX: Final = 500e-6
WINDOW_S: Final = 0.5
CORE_FRACTION_MIN: Final = 0.25


class RouterLoad:
    """The router's processor time, judged by the answers that the world got for it."""

    def __init__(self) -> None:
        self._since: tuple[float, float, int] | None = None

    def suspicious(self, cpu_s: float, now_s: float, answers: int) -> bool:
        """Return whether the router works for other things than answers; all three values grow through the run."""
        if self._since is None:
            self._since = cpu_s, now_s, answers
        cpu_0_s, begin_s, answers_0 = self._since
        spent_s = cpu_s - cpu_0_s
        if spent_s < WINDOW_S:
            return False
        self._since = cpu_s, now_s, answers
        busy = spent_s > CORE_FRACTION_MIN * (now_s - begin_s)
        return busy and spent_s > ANSWER_S_MAX * (answers - answers_0)


class DenialGuard:
    """An observer of ticks. A node with FLOOD denied operations in the run has crashed; its program on this machine is ended.

    What others tried with its credential before the run does not count. `node_of_session` tells which joined node a router's
    session belongs to, -1 for none; without it the run has no router. `log` is the security log of the run, if it has one.
    """

    def __init__(self, log: "SecurityLog | None", node_of_session: Callable[[str], int] | None = None) -> None:
        self._log = log
        self._node_of_session = node_of_session
        self._load = RouterLoad()
        self._counts: RouterCounts | None = None if log is None else log.router
        self._before = {} if self._counts is None else self._counts.denials()

    def __call__(self, world: World) -> None:
        """Look at the router before the next tick."""
        if self._node_of_session is None:
            return
        if self._counts is None:
            # All threads but this one are the router's.
            router_s = time.process_time() - time.thread_time()
            if not self._load.suspicious(router_s, time.monotonic(), world.intake.observed_count):
                return
            from zwerm.deploy.router_messages import RouterCounts

            self._counts = RouterCounts(self._node_of_session)
        for node, count in self._counts.denials().items():
            if count - self._before.get(node, 0) >= FLOOD and node not in world.status.crashed:
                world.evict(node, f"{FLOOD} of its operations were denied by the router")

    def note_refusals(self, world: World) -> None:
        """Write what `world` refuses to the security log, if there is one."""
        if self._log is not None:
            world.intake.refusals.listener = self._log.note

    def refusals(self) -> Refusals:
        """Return what the router has refused so far, as far as its log was read."""
        return Refusals() if self._counts is None else self._counts.settled()

    @property
    def problems(self) -> list[str]:
        """Why the security log is incomplete, if it is."""
        return [] if self._log is None or not self._log.error else [self._log.error]

    def close(self) -> None:
        """Stop counting what the router refuses, unless the security log goes on."""
        if self._counts is not None and self._log is None:
            self._counts.close()
