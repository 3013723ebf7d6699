"""What `zwerm twin` does: one run a transport, each compared, and all told at the end."""

import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from enum import StrEnum
from typing import Any

import msgspec
from rich.console import Console

from zwerm.deploy.network.impairments import possible
from zwerm.link.peer_radio import Transport
from zwerm.run.assembly import assemble
from zwerm.run.runner import ProgressListener
from zwerm.scenario.tables import Scenario
from zwerm.twin.packet_comparison import compare
from zwerm.twin.twin_report import print_twin
from zwerm.twin.twin_runner import run_twin, usable


class Transports(StrEnum):
    """What the twin's packets may cross the network by."""

    udp = "udp"
    tcp = "tcp"
    both = "both"

    def chosen(self) -> Sequence[Transport]:
        """Return the transports to run over, in order."""
        return ("udp", "tcp") if self is Transports.both else ("udp",) if self is Transports.udp else ("tcp",)


def run_and_tell(
    scenario: Scenario,
    seed: int,
    transports: Sequence[Transport],
    as_json: bool,
    out: Console,
    err: Console,
    progress: Callable[[str], AbstractContextManager[ProgressListener]],
) -> set[str]:
    """Run a scenario's twin over each transport, tell on `out` or as JSON what became of its packets; return the outcomes.

    `progress`, of a run's name, shows how it is getting on.

    Raises LinkError where this machine cannot have a network of a run's own, ScenarioError for what no network could do.
    """
    usable()
    assemble(scenario, seed)  # for the mistakes in what may be left out
    chosen, skipped = possible(scenario)
    found: dict[str, dict[str, Any]] = {}
    for transport in transports:
        with progress(f"{scenario.name}, {transport}") as watcher:
            result = run_twin(chosen, seed, transport, watcher)
        found[transport] = compare(result)
        if result.reason:
            err.print(f"zwerm: {result.reason}", style="red", markup=False, highlight=False, soft_wrap=True)
        if result.outcome == "interrupted":
            break
    if as_json:
        told = {"scenario": scenario.name, "seed": seed, "skipped": skipped, "transports": found}
        sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
    else:
        print_twin(out, f"{scenario.name}, seed {seed}: its twin on a real network", found, skipped)
    return {each["outcome"] for each in found.values()}
