"""Ends robots that flood the router with operations that it denies. It reports these in the security log only."""

from zwerm.deploy.security_log import SecurityLog
from zwerm.world.world import FLOOD, World


class DenialGuard:
    """An observer of ticks. A node with FLOOD denied operations in the run has crashed; its program on this machine is ended.

    What others tried with its credential before the run does not count.
    """

    def __init__(self, security: SecurityLog) -> None:
        self._security = security
        self._before = security.denials()

    def __call__(self, world: World) -> None:
        """Look at the router's counts before the next tick."""
        for node, count in self._security.denials().items():
            if count - self._before.get(node, 0) >= FLOOD and node not in world.status.crashed:
                world.crash(node, f"flood: {FLOOD} of its operations were denied by the router")
                world.on_flood(node)
