"""What was tried, and failed: kept by place and side, since robots come and go."""

from zwerm.agents.sensor_coverage.frontier.services import Plan

Key = tuple[int, ...]


class AttemptLog:
    """Attempts by what they would have expanded; what is `closed` is not tried again, `failed` only from another place.

    `blocked` has the directions in which a wall stopped a drive, by the place that it began at.
    """

    def __init__(self, attempts_max: int, near_wall_m: float, blocked: dict[int, list[float]] | None = None) -> None:
        self.closed: dict[Key, None] = {}
        self.failed: dict[tuple[Key, int], None] = {}
        self.attempts: dict[Key, int] = {}
        self.blocked: dict[int, list[float]] = {} if blocked is None else blocked
        self._attempts_max = attempts_max
        self._near_wall_m = near_wall_m

    def note_attempt(self, plan: Plan) -> None:
        """Take note that a plan is being tried; the same side is not tried for ever."""
        self.attempts[plan.key] = self.attempts.get(plan.key, 0) + 1
        if self.attempts[plan.key] >= self._attempts_max:
            self.closed[plan.key] = None

    def note_failure(self, plan: Plan, driven_m: float) -> None:
        """Take note that a wall was in the way after so far.

        One failure closes an edge's side, unless it was so near to one end that it says nothing about the other.
        """
        elsewhere = any((plan.key, end) in self.failed for end in plan.key[:2] if end != plan.mover)
        if driven_m > self._near_wall_m or plan.key[2] == 0 or elsewhere:
            self.closed[plan.key] = None
        self.failed[plan.key, plan.mover] = None
        self.blocked.setdefault(plan.mover, []).append(plan.direction)
