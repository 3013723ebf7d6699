"""`zwerm twin`: run a scenario with its packets on a real network."""

from typing import Annotated, Literal

import typer

from zwerm.cli.options import Json, ScenarioName, Seed, Sets
from zwerm.cli.terminal import EXIT_FAILED, EXIT_INTERRUPTED, err, errors_as_lines, out, print_json


def twin(
    scenario: ScenarioName,
    seed: Seed = 1,
    sets: Sets = None,
    transport: Annotated[
        Literal["udp", "tcp", "both"],
        typer.Option("--transport", help="The transport of Zenoh; with `both`, two runs one after the other."),
    ] = "both",
    as_json: Json = False,
) -> None:
    """Run a scenario on a real network, in real time: every robot in a network namespace of its own.

    Every packet goes over Zenoh through nftables and tc, which lose and delay packets by the rules of the scenario's
    models. The models judge the same packets, and the results of both are printed side by side. Needs Linux and root;
    leaves nothing behind.

    Examples:

    [bold]zwerm twin beacon-twin[/bold]

    [bold]zwerm twin gossip-max --transport tcp --set robots.count=8 --set time.duration_s=10 --json[/bold]
    """
    from zwerm.cli.console import RunProgress
    from zwerm.scenario.load import load
    from zwerm.twin.transports import Transports, run_and_report

    with errors_as_lines():
        loaded = load(scenario, tuple(sets or ()))
        outcomes = run_and_report(
            loaded,
            seed,
            Transports(transport).chosen(),
            print_json if as_json else None,
            out,
            err,
            lambda name: RunProgress(err, name, quiet=as_json),
        )
    raise typer.Exit(EXIT_INTERRUPTED if "interrupted" in outcomes else EXIT_FAILED if "failed" in outcomes else 0)
