"""`zwerm world`: run the world of a scenario whose robots are started on other machines."""

from pathlib import Path
from typing import Annotated, Optional

import typer

from zwerm.cli.options import (
    OUTAGE_S,
    Animation,
    Bare,
    ColourBy,
    HostNames,
    Json,
    Links,
    Outage,
    Picture,
    PictureAt,
    PictureSize,
    RadioTable,
    RealTime,
    Record,
    ScenarioName,
    Seed,
    Sets,
    check_endpoint,
)
from zwerm.cli.terminal import err, errors_as_lines


def world(
    scenario: ScenarioName,
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
        typer.Option("--plain", help="Allow tcp/ beyond this machine: anybody on the way can read and change all."),
    ] = False,
    seed: Seed = 1,
    sets: Sets = None,
    realtime: RealTime = None,
    record: Record = None,
    picture: Picture = None,
    picture_at: PictureAt = None,
    animate: Animation = None,
    size: PictureSize = None,
    bare: Bare = False,
    colour_by: ColourBy = None,
    links: Links = None,
    radio_table: RadioTable = None,
    as_json: Json = False,
) -> None:
    """Run the world of a scenario and wait for robots on other machines to connect.

    Writes the robots' credentials to a file that only you can read; carry it to where the robots run. Where several hosts run
    robots, make the credentials of each with [bold]zwerm keys[/bold]. By tls/ and quic/ both ends prove who they are.

    Examples:

    [bold]zwerm world computation-free --listen tls/0.0.0.0:7447 --name world.example.org --credentials robots.key[/bold]

    [bold]zwerm world computation-free --listen tls/0.0.0.0:7447 --keys keys/world.key[/bold]
    """
    from zwerm.cli.console import RunProgress
    from zwerm.cli.run_output import RunOutput
    from zwerm.run.runner import serve
    from zwerm.scenario.load import load

    with errors_as_lines():
        for endpoint in listen:
            check_endpoint("--listen", endpoint)
        moments = tuple(picture_at or ())
        output = RunOutput(picture, moments, animate, radio_table, as_json, record, size, bare, colour_by, links)
        loaded = load(scenario, tuple(sets or ()))
        with RunProgress(err, loaded.name, quiet=as_json) as progress:
            result = serve(
                loaded,
                seed,
                listen,
                credentials,
                realtime=realtime,
                watcher=progress,
                record=record,
                keys_file=keys,
                names=names or (),
                lease_s=outage_s,
                plain=plain,
            )
        output.report(result)
