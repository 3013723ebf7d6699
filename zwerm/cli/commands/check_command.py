"""`zwerm check`: load and assemble scenarios without running them."""

from typing import Annotated

import typer

from zwerm.cli.options import Sets
from zwerm.cli.terminal import errors_as_lines, out
from zwerm.errors import ScenarioError


def check(
    scenarios: Annotated[list[str], typer.Argument(help="Built-in names or TOML files.")], sets: Sets = None
) -> None:
    """Check scenarios, and report every mistake with its place, the rule and the value.

    Examples: [bold]zwerm check my.toml[/bold], [bold]zwerm check computation-free --set robots.count=30[/bold]
    """
    from zwerm.run.validation import scenario_mistakes
    from zwerm.scenario.load import locate

    diagnostics: list[str] = []
    for name in scenarios:
        found = scenario_mistakes(name, tuple(sets or ()))
        diagnostics += found
        if not found:
            out.print(f"{locate(name)}: no mistakes", markup=False, highlight=False, soft_wrap=True)
    if diagnostics:
        with errors_as_lines():
            raise ScenarioError(diagnostics)
