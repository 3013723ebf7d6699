"""Options and output that `zwerm study` and `zwerm compare` share."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn, Optional

import typer

from zwerm.cli.output_files import ROWS, OutputFile, check_outputs
from zwerm.cli.terminal import EXIT_FAILED, EXIT_INTERRUPTED, err
from zwerm.errors import ZwermError

if TYPE_CHECKING:  # studies need joblib and pyarrow
    from zwerm.study.study_runner import StudyResult

Seeds = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--seeds", metavar="N|FIRST-LAST", help="Seeds 1 to N, or FIRST to LAST, instead of the study's."),
]
Jobs = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option("--jobs", min=1, help="The number of trials that run at a time; by default one per core."),
]
Out = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--out",
        metavar="FILE",
        help="The file of rows: .parquet, or .csv for both; runs/NAME.parquet by default.",
    ),
]
Timeout = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--timeout", min=1.0, metavar="S", help="End a trial without a result after S seconds; it has failed."
    ),
]
Retry = Annotated[bool, typer.Option("--retry", help="Repeat failed trials.")]


@contextmanager
def study_extra() -> Iterator[None]:
    """Report a missing package of the extra `study` in one line: raises ZwermError."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ZwermError(f"needs {error.name}: pip install 'zwerm[study]'") from None


def rows_file(output: Path | None, name: str) -> Path:
    """Return the Parquet file of a study; beside it go the picture and, if the user asks for it, the CSV file.

    Raises ScenarioError where they cannot be written.
    """
    path = output or Path("runs") / f"{name}.parquet"
    check_outputs([OutputFile("--out", path, ROWS)])
    return path.with_suffix(".parquet")


def write_files(*writers: tuple[Path | None, Callable[[], Sequence[Path]]]) -> tuple[list[Path], list[str]]:
    """Write the files of a study, each by its function, and return those written, and why others cannot be written.

    The result is printed anyway.
    """
    paths: list[Path] = []
    problems: list[str] = []
    for path, write in writers:
        try:
            paths += write()
        except ZwermError as error:
            problems.append(str(error))
        except OSError as error:
            problems.append(f"{path}: cannot be written: {error.strerror}")
    return paths, problems


def raise_problems(result: "StudyResult", problems: Sequence[str]) -> None:
    """Raise ZwermError where the rows of a study or its files could not be written."""
    if lines := [*result.problems, *problems]:
        raise ZwermError("\n".join(lines))


def write_csv(output: Path | None, result: "StudyResult") -> list[Path]:
    """Write the rows as CSV where `output` asks for it, and return the files written."""
    from zwerm.study.rows import export_csv

    if output is None or output.suffix.lower() != ".csv" or not result.path.exists():
        return []
    return [export_csv(result.path, output)]


def print_trial_counts(result: "StudyResult", drawn: list[Path]) -> None:
    """Print how many trials ran, and the files written."""
    ran = f"{result.done} of {result.planned} trials, {result.ran} of them run now: {result.path}"
    err.print(ran, highlight=False, soft_wrap=True)
    for why in result.unknown:
        err.print(f"its rows are not used again: {why}", markup=False, highlight=False, soft_wrap=True)
    for each in drawn:
        kind = "rows as CSV" if each.suffix.lower() == ".csv" else "picture"
        err.print(f"{kind}: {each}", highlight=False, soft_wrap=True)


def exit_with(result: "StudyResult", failed_trials_count: bool = True) -> NoReturn:
    """Exit with the status of the result. A comparison with failed trials succeeds: failures are part of its result."""
    if result.interrupted:
        err.print("zwerm: interrupted; the same command goes on from here", style="red")
        raise typer.Exit(EXIT_INTERRUPTED)
    raise typer.Exit(EXIT_FAILED if result.failed and failed_trials_count else 0)
