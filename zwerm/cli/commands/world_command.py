"""`zwerm world`: run the world of a scenario whose robots are started on other machines."""

from pathlib import Path
from typing import Annotated

import typer

from zwerm.cli.options import (
    Animation,
    Bare,
    ColourBy,
    Json,
    Links,
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
    credentials: Annotated[Path, typer.Option("--credentials", help="The file to write the robots' credentials to.")],
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

    Writes the robots' credentials to a file that only you can read; carry it to where the robots run.

    Example: [bold]zwerm world computation-free --listen tcp/0.0.0.0:7447 --credentials robots.key[/bold]
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
            result = serve(loaded, seed, listen, credentials, realtime=realtime, watcher=progress, record=record)
        output.report(result)
