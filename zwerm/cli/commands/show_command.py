"""`zwerm show`: print the file of a scenario or study."""

from typing import Annotated

import typer

from zwerm.cli.options import Sets, built_in_names
from zwerm.cli.terminal import err, errors_as_lines


def show(
    name: Annotated[
        str,
        typer.Argument(
            help="A built-in scenario or study (see `zwerm list`), or a TOML file.",
            autocompletion=built_in_names("scenarios", "studies"),
        ),
    ],
    sets: Sets = None,
) -> None:
    """Print a scenario or a study, to read it or to start a file of your own. Its path goes to standard error.

    With --set the scenario is printed as it would be run, without comments.

    Examples: [bold]zwerm show gossip-max[/bold], [bold]zwerm show gossip-max --set radio.loss=0.3 > mine.toml[/bold]
    """
    from zwerm.scenario.load import load, locate, tables_of
    from zwerm.scenario.toml import write_toml
    from zwerm.study.study_tables import built_in as built_in_studies

    with errors_as_lines():
        path = built_in_studies().get(name) or locate(name)
        err.print(str(path), markup=False, highlight=False, soft_wrap=True)
        if sets:
            load(str(path), tuple(sets))
            tables, _ = tables_of(str(path), tuple(sets))
            typer.echo(write_toml(tables), nl=False)
        else:
            typer.echo(path.read_text(encoding="utf-8"), nl=False)
