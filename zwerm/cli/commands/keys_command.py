"""`zwerm keys`: make the certificates and credentials of a run over several hosts, a file for each host."""

from pathlib import Path
from typing import Annotated, Optional

import typer

from zwerm.cli.options import OUTAGE_S, HostNames, Outage, ScenarioName, Sets
from zwerm.cli.terminal import err, errors_as_lines


def keys(
    scenario: ScenarioName,
    folder: Annotated[Path, typer.Argument(help="A new folder for the files.")],
    names: HostNames = None,
    hosts: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--host", metavar="NAME=IDS", help="The nodes of one host, such as left=0-24; may be given often."
        ),
    ] = None,
    outage_s: Outage = OUTAGE_S,
    sets: Sets = None,
) -> None:
    """Make an authority, the world's certificate and one for each robot, and write a file of credentials for each host.

    world.key stays with the world. NAME.key goes to the host NAME, and holds nothing of other hosts' robots. Without --host all
    robots are in robots.key. The private key of the authority is not kept. Certificates are valid for 30 days.

    Example: [bold]zwerm keys gossip-max keys --name world.example.org --host left=0-14 --host right=15-29[/bold]
    """
    from zwerm.deploy.host_keys import write_host_keys
    from zwerm.deploy.node_specs import node_specs
    from zwerm.scenario.load import load

    with errors_as_lines():
        nodes = list(node_specs(load(scenario, tuple(sets or ())), 1))
        for path in write_host_keys(folder, nodes, names or (), hosts or (), outage_s):
            err.print(f"written: {path}", markup=False, highlight=False, soft_wrap=True)
