"""`zwerm world`: run the world of a scenario whose robots are started on other machines."""

from pathlib import Path
from typing import Annotated, Optional

import typer

from zwerm.cli.options import OUTAGE_S, HostNames, Outage, check_endpoint
from zwerm.cli.run_options import RunOptions, with_run_options
from zwerm.cli.terminal import err, errors_as_lines


@with_run_options
def world(
    options: RunOptions,
    listen: Annotated[list[str], typer.Option("--listen", help="A Zenoh endpoint, such as tcp/0.0.0.0:7447.")],
    credentials: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--credentials", metavar="FILE", help="A new file to write the credentials of all robots to."),
    ] = None,
    keys: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--keys", metavar="FILE", help="The world's keys that `zwerm keys` made, in place of --credentials."
        ),
    ] = None,
    names: HostNames = None,
    outage_s: Outage = OUTAGE_S,
    plain: Annotated[
        bool,
        typer.Option(
            "--plain", help="Allow tcp/ beyond this machine: hosts on the route can read and change messages."
        ),
    ] = False,
) -> None:
    """Run the world of a scenario and wait for robots on other machines to connect.

    Writes the robots' credentials to a file that only you can read; copy it to the machines on which the robots run. If
    several hosts run robots, make the credentials of each host with [bold]zwerm keys[/bold]. With tls/ and quic/ both
    ends are authenticated.

    Examples:

    [bold]zwerm world computation-free --listen tls/0.0.0.0:7447 --name world.example.org --credentials
    robots.key[/bold]

    [bold]zwerm world computation-free --listen tls/0.0.0.0:7447 --keys keys/world.key[/bold]
    """
    from zwerm.cli.console import RunProgress
    from zwerm.run.runner import serve

    with errors_as_lines():
        for endpoint in listen:
            check_endpoint("--listen", endpoint)
        output, loaded = options.output(), options.load()
        with RunProgress(err, loaded.name, quiet=options.shows_no_progress) as progress:
            result = serve(
                loaded,
                options.seed,
                listen,
                credentials,
                realtime=options.realtime,
                watcher=progress,
                record=options.record,
                security_log=options.security_log,
                keys_file=keys,
                names=names or (),
                lease_s=outage_s,
                plain=plain,
            )
        output.report(result)
