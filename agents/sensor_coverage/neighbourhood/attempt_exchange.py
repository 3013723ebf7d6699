"""What was tried at the edges of a place, as neighbours tell each other."""

from collections.abc import Iterable

from zwerm.agents.sensor_coverage.frontier.attempt_log import AttemptLog
from zwerm.agents.sensor_coverage.messages.peers import Attempt, StateBeacon
from zwerm.maths.simplicial import edge


def other_end(key: tuple[int, ...], me: int) -> int:
    """Return the place at the other end of the edge that a key begins with."""
    return key[1] if key[0] == me else key[0]


def tell(tried: AttemptLog, me: int) -> tuple[Attempt, ...]:
    """Return what was tried at the edges of place `me`."""
    keys = dict.fromkeys((*tried.attempts, *tried.closed, *(key for key, _ in tried.failed)))
    return tuple(
        Attempt(other_end(key, me), key[2], tried.attempts.get(key, 0), (key, me) in tried.failed, key in tried.closed)
        for key in sorted(keys)
        if len(key) == 3
    )


def hear(tried: AttemptLog, me: int, states: Iterable[StateBeacon], attempts_max: int) -> None:
    """Take in what neighbours tried at the edges that they have in common with place `me`."""
    for state in states:
        for each in state.tries:
            if each.other == me:
                key = (*edge(me, state.place), each.sign)
                if each.failed:
                    tried.failed[key, state.place] = None
                if each.closed or each.attempts + tried.attempts.get(key, 0) >= attempts_max:
                    tried.closed[key] = None
