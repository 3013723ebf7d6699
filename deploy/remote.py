"""Run some of a swarm's robots on this machine, for a world on another machine."""

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from zwerm.agents.runtime.confinement import UNCONFINED, Confinement
from zwerm.deploy.endpoints import is_encrypted, is_loopback
from zwerm.deploy.identity import load, slice_of
from zwerm.deploy.supervisor import JOIN_DEADLINE_S, LocalSupervisor, prepare
from zwerm.errors import LinkError

# The largest id that is looked up. A longer range could fill the memory.
ID_MAX: Final = 99_999
_DIGITS_MAX: Final = 9
_RANGE: Final = re.compile(r"([0-9]+)(?:-([0-9]+))?")


def parse_ids(text: str, place: str = "--ids") -> list[int]:
    """Return the ids in `3`, `0-24` or `0-4,10-14`, ascending. Raises LinkError for anything else, led by `place`."""
    ids: set[int] = set()
    for part in text.split(","):
        found = _RANGE.fullmatch(part.strip())
        first, last = found.groups() if found else ("", None)
        if found and (max(map(len, (first, last or ""))) > _DIGITS_MAX or max(int(first), int(last or first)) > ID_MAX):
            raise LinkError(f"{place}: expected ids of at most {ID_MAX}, got {text!r:.80}")
        if not found or int(last or first) < int(first):
            raise LinkError(f"{place}: expected ids such as 3, 0-24 or 0-4,10-14, got {text!r:.80}")
        ids.update(range(int(first), int(last or first) + 1))
    return sorted(ids)


def run_robots(
    endpoint: str,
    credentials_file: Path,
    ids: str = "",
    progress: Callable[[int, int], object] | None = None,
    deadline_s: float = JOIN_DEADLINE_S,
    confinement: Confinement = UNCONFINED,
) -> dict[int, int]:
    """Start the robots `ids` (all in the file, if empty), wait until they end, and return their exit codes by id.

    Raises LinkError if the file cannot be used, or a robot does not join within `deadline_s`.
    """
    credentials = load(credentials_file)
    if credentials.authority_pem and not is_encrypted(endpoint) and not is_loopback(endpoint):
        raise LinkError(f"{endpoint}: these credentials are for a tls/ or quic/ endpoint")
    if ids:
        credentials = slice_of(credentials, parse_ids(ids))
    prepare(len(credentials.nodes))
    start_s = time.monotonic()
    with LocalSupervisor(endpoint, credentials, confinement=confinement) as supervisor:
        supervisor.start(progress, deadline_s - (time.monotonic() - start_s))
        supervisor.wait()
        return supervisor.exit_codes
