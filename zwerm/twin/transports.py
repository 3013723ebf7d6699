"""Run the twin of a scenario over each transport, and print the comparison with the models."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from enum import StrEnum
from typing import Any

from rich.console import Console

from zwerm.deploy.network.impairments import supported
from zwerm.link.peer_radio import Transport
from zwerm.run.assembly import assemble
from zwerm.run.progress import ProgressListener
from zwerm.scenario.tables import Scenario
from zwerm.twin.packet_comparison import compare
from zwerm.twin.twin_report import print_twin
from zwerm.twin.twin_runner import require_namespaces, run_twin


class Transports(StrEnum):
    """Transport of the twin's packets."""

    udp = "udp"
    tcp = "tcp"
    both = "both"

    def chosen(self) -> Sequence[Transport]:
        """Return the transports to run over, in order."""
        return ("udp", "tcp") if self is Transports.both else ("udp",) if self is Transports.udp else ("tcp",)


def run_and_report(
    scenario: Scenario,
    seed: int,
    transports: Sequence[Transport],
    write_json: Callable[[dict[str, Any]], object] | None,
    out: Console,
    err: Console,
    progress: Callable[[str], AbstractContextManager[ProgressListener]],
) -> set[str]:
    """Run a scenario's twin over each transport, print the comparison on `out`, and return the outcomes.

    With `write_json` that gets the comparison instead, as one object. `progress` returns the progress listener of a run
    from its name. Raises LinkError if this machine cannot create network namespaces, and ScenarioError for a scenario that
    a real network cannot reproduce.
    """
    require_namespaces()
    assemble(scenario, seed)  # reports errors also in models that may be skipped
    chosen, skipped = supported(scenario)
    found: dict[str, dict[str, Any]] = {}
    for transport in transports:
        with progress(f"{scenario.name}, {transport}") as listener:
            result = run_twin(chosen, seed, transport, listener)
        found[transport] = compare(result)
        if result.reason:
            err.print(f"zwerm: {result.reason}", style="red", markup=False, highlight=False, soft_wrap=True)
        if result.outcome == "interrupted":
            break
    if write_json is not None:
        write_json({"scenario": scenario.name, "seed": seed, "skipped": skipped, "transports": found})
    else:
        print_twin(out, f"{scenario.name}, seed {seed}: its twin on a real network", found, skipped)
    return {each["outcome"] for each in found.values()}
