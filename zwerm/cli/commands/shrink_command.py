"""`zwerm shrink`: reduce a failing schedule of faults to a smallest one that still fails."""

from pathlib import Path
from typing import Annotated, Optional

import typer

from zwerm.cli.options import ScenarioName, Seed, Sets
from zwerm.cli.terminal import err, errors_as_lines, out


def shrink(
    scenario: ScenarioName,
    failing: Annotated[
        str, typer.Option("--failing", metavar="CONDITION", help="The condition of a failure, such as 'METRIC < 0.5'.")
    ],
    seed: Seed = 1,
    sets: Sets = None,
    output: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--out", metavar="FILE.toml", help="The file to write; runs/SCENARIO-shrunk.toml by default."),
    ] = None,
) -> None:
    """Reduce a failing schedule of faults to a smallest one that still fails, and write it as a scenario.

    Example: [bold]zwerm shrink my.toml --seed 7 --failing 'cell_coverage_fraction < 0.5'[/bold]
    """
    from zwerm.cli.console import RunProgress
    from zwerm.run.shrinking import Shrinker, parse_failing, tables_of, with_faults
    from zwerm.scenario.load import load
    from zwerm.scenario.toml import write_toml

    with errors_as_lines():
        loaded = load(scenario, tuple(sets or ()))
        path = output or Path("runs") / f"{loaded.name}-shrunk.toml"
        with RunProgress(err, loaded.name) as progress:
            shrinker = Shrinker(loaded, seed, parse_failing(failing), progress.shrunk)
            faults = shrinker.shrink()
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(write_toml(tables_of(with_faults(loaded, faults))), encoding="utf-8")
    out.print(
        f"{len(faults)} faults are enough, found in {shrinker.tried} runs: {path}", highlight=False, soft_wrap=True
    )
    out.print(write_toml({"faults": list(faults)}), markup=False, highlight=False, end="")
