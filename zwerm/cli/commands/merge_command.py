"""`zwerm merge`: unite the rows of a study's shards."""

import re
from pathlib import Path
from typing import Annotated, Optional

import typer

from zwerm.cli.output_files import ROWS, OutputFile, check_outputs
from zwerm.cli.terminal import err, errors_as_lines
from zwerm.cli.trials import study_extra
from zwerm.errors import ScenarioError


def merge(
    parts: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Files of rows, such as those of all shards.")],
    output: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--out", metavar="FILE.parquet", help="The file of all rows; by default the study's, beside the shards."
        ),
    ] = None,
) -> None:
    """Unite the rows of a study's shards in one file, each trial once.

    Rows that the file has already stay. Two files with different results of one trial are refused. After it,
    [bold]zwerm study[/bold] with this file prints and draws the results, and runs the trials that are missing.

    Example: [bold]zwerm merge runs/my-study-shard-*-of-8.parquet && zwerm study my-study.toml[/bold]
    """
    with errors_as_lines():
        with study_extra():
            from zwerm.study.distribute.merging import merge_files
        path = output or _study_file(parts)
        check_outputs([OutputFile("--out", path, ROWS[:1])])
        count = merge_files(parts, path)
        err.print(f"{count} rows: {path}", highlight=False, soft_wrap=True)


def _study_file(parts: list[Path]) -> Path:
    """Return the file of the study whose shards these are. Raises ScenarioError where that is not clear."""
    first, *others = [part.parent / (re.sub(r"-shard-\d+-of-\d+$", "", part.stem) + part.suffix) for part in parts]
    if any(other != first for other in others) or first in parts:
        raise ScenarioError(["--out: give it: the files are not named as the shards of one study"])
    return first
