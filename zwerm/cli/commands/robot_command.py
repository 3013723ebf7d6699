"""`zwerm robot`: run robots on this machine for a world on another one."""

from pathlib import Path
from typing import Annotated

import typer

from zwerm.cli.options import RobotMemory, RobotProcesses, RobotUsers, check_endpoint
from zwerm.cli.terminal import EXIT_FAILED, err, errors_as_lines


def robot(
    connect: Annotated[str, typer.Option("--connect", help="The world's Zenoh endpoint.")],
    credentials: Annotated[Path, typer.Option("--credentials", help="The file that `zwerm world` wrote.")],
    ids: Annotated[str, typer.Option("--ids", help="The robots to run here: 3, 0-24 or 0-4,10-14.")] = "",
    robot_users: RobotUsers = None,
    robot_memory: RobotMemory = None,
    robot_processes: RobotProcesses = None,
) -> None:
    """Run robots that connect to a world elsewhere, each in a process of its own.

    Example: [bold]zwerm robot --connect tcp/192.0.2.1:7447 --credentials robots.key --ids 0-24[/bold]
    """
    from zwerm.agents.runtime.confinement import Confinement
    from zwerm.cli.console import RunProgress
    from zwerm.deploy.remote import run_robots

    with errors_as_lines():
        check_endpoint("--connect", connect)
        confinement = Confinement(robot_users, robot_memory, robot_processes)
        with RunProgress(err, "swarm") as progress:
            codes = run_robots(connect, credentials, ids, progress.joined, confinement=confinement)
        failed = {node: code for node, code in codes.items() if code}
        for node, code in sorted(failed.items()):
            err.print(f"zwerm: node {node} ended with exit code {code}", style="red", markup=False, highlight=False)
        raise typer.Exit(EXIT_FAILED if failed else 0)
