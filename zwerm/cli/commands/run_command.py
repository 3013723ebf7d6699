"""`zwerm run`: run a scenario with all its robots on this machine."""

from typing import Annotated

import typer

from zwerm.cli.options import RobotMemory, RobotProcesses, RobotUsers
from zwerm.cli.run_options import RunOptions, with_run_options
from zwerm.cli.terminal import err, errors_as_lines


@with_run_options
def run(
    options: RunOptions,
    inline: Annotated[
        bool, typer.Option("--inline/--processes", help="Run the robots in this process: faster, same trace.")
    ] = False,
    robot_users: RobotUsers = None,
    robot_memory: RobotMemory = None,
    robot_processes: RobotProcesses = None,
) -> None:
    """Run a scenario: the world in this process, and every robot in a process of its own.

    Examples:

    [bold]zwerm run computation-free[/bold]

    [bold]zwerm run computation-free --seed 7 --set robots.count=40 --animate swarm.gif[/bold]

    [bold]zwerm run sensor-coverage --picture-at 40 --picture-at 300s --animate swarm.mp4[/bold]

    [bold]zwerm run computation-free --inline --json[/bold]

    [bold]zwerm run computation-free --set robots.controller=my_file:MyController[/bold]
    """
    from zwerm.agents.runtime.confinement import Confinement
    from zwerm.cli.console import RunProgress
    from zwerm.cli.debugger import breakpoints
    from zwerm.run.runner import run as run_scenario

    with errors_as_lines():
        output, loaded = options.output(), options.load()
        with RunProgress(err, loaded.name, quiet=options.shows_no_progress) as progress, breakpoints(progress.suspend):
            result = run_scenario(
                loaded,
                options.seed,
                "inline" if inline else "processes",
                realtime=options.realtime,
                watcher=progress,
                record=options.record,
                security_log=options.security_log,
                confinement=Confinement(robot_users, robot_memory, robot_processes),
            )
        output.report(result)
