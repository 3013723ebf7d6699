"""`zwerm new`: write a small project that runs, as the start of a user's own."""

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from zwerm.cli.terminal import errors_as_lines, out
from zwerm.errors import ScenarioError


def new(folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that is made, or is empty.")]) -> None:
    """Write a small project into a folder: a controller, a scenario, a metric, a study and a test, all of which run.

    Example: [bold]zwerm new flock && cd flock && zwerm run scenario.toml --inline[/bold]
    """
    from zwerm.cli.project_files import FILES

    with errors_as_lines():
        try:
            if folder.exists() and any(folder.iterdir()):
                raise ScenarioError([f"{folder}: expected a folder that does not exist, or is empty"])
            folder.mkdir(parents=True, exist_ok=True)
            for name, text in FILES.items():
                (folder / name).write_text(text, encoding="utf-8")
        except OSError as error:
            raise ScenarioError([f"{folder}: cannot be written: {error.strerror}"]) from None
    for name in FILES:
        out.print(str(folder / name), markup=False, highlight=False, soft_wrap=True)
    out.print(
        f"\ncd {quote(str(folder))}, and look at README.md for what to run",
        markup=False,
        highlight=False,
        soft_wrap=True,
    )
