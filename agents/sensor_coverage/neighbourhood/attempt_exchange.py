"""Exchange of failed attempts between neighbours, as part of their state beacons."""

from collections.abc import Iterable

from zwerm.agents.sensor_coverage.frontier.attempt_log import AttemptLog
from zwerm.agents.sensor_coverage.messages.beacons import Attempt, StateBeacon
from zwerm.maths.simplicial import edge


def other_end(key: tuple[int, ...], me: int) -> int:
    """Return the slot at the other end of the edge that a key begins with."""
    return key[1] if key[0] == me else key[0]


def attempts_at(log: AttemptLog, me: int) -> tuple[Attempt, ...]:
    """Return the attempts at the edges of slot `me`, to announce to neighbours."""
    keys = dict.fromkeys((*log.attempts, *log.closed, *(key for key, _ in log.failed)))
    return tuple(
        Attempt(other_end(key, me), key[2], log.attempts.get(key, 0), (key, me) in log.failed, key in log.closed)
        for key in sorted(keys)
        if len(key) == 3
    )


def take_over(log: AttemptLog, me: int, states: Iterable[StateBeacon], attempts_max: int) -> None:
    """Take over the attempts that neighbours announced at their common edges with slot `me`."""
    for state in states:
        for each in state.attempts:
            if each.other == me:
                key = (*edge(me, state.slot), each.sign)
                if each.failed:
                    log.failed[key, state.slot] = None
                if each.closed or each.attempts + log.attempts.get(key, 0) >= attempts_max:
                    log.closed[key] = None
