"""`zwerm run`: run a scenario with all its robots on this machine."""

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
    Quiet,
    RadioTable,
    RealTime,
    Record,
    ScenarioName,
    Seed,
    Sets,
)
from zwerm.cli.terminal import err, errors_as_lines


def run(
    scenario: ScenarioName,
    seed: Seed = 1,
    sets: Sets = None,
    inline: Annotated[
        bool, typer.Option("--inline/--processes", help="Run the robots in this process: faster, same trace.")
    ] = False,
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
    quiet: Quiet = False,
) -> None:
    """Run a scenario: the world in this process, and every robot in a process of its own.

    Examples:

    [bold]zwerm run computation-free[/bold]

    [bold]zwerm run computation-free --seed 7 --set robots.count=40 --animate swarm.gif[/bold]

    [bold]zwerm run sensor-coverage --picture-at 40 --picture-at 300s --animate swarm.mp4[/bold]

    [bold]zwerm run computation-free --inline --json[/bold]

    [bold]zwerm run computation-free --set robots.controller=my_file:MyController[/bold]
    """
    from zwerm.cli.console import RunProgress
    from zwerm.cli.debugger import breakpoints
    from zwerm.cli.run_output import RunOutput
    from zwerm.run.runner import run as run_scenario
    from zwerm.scenario.load import load

    with errors_as_lines():
        moments = tuple(picture_at or ())
        output = RunOutput(picture, moments, animate, radio_table, as_json, record, size, bare, colour_by, links)
        loaded = load(scenario, tuple(sets or ()))
        with RunProgress(err, loaded.name, quiet=as_json or quiet) as progress, breakpoints(progress.suspend):
            result = run_scenario(
                loaded, seed, "inline" if inline else "processes", realtime=realtime, watcher=progress, record=record
            )
        output.report(result)
