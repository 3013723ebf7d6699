"""The commands of many trials: `zwerm study` and `zwerm compare`."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NoReturn, Optional

import typer

from zwerm.cli.options import Json, ScenarioName, Sets
from zwerm.cli.terminal import (
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    err,
    mistakes_in_one_line,
    out,
    print_json,
)
from zwerm.errors import ZwermError

if TYPE_CHECKING:  # studies need joblib and pyarrow
    from zwerm.study.study_runner import StudyResult

STUDY_HELP: Final = (
    "Run a study: scenarios over a grid of settings and many seeds, set beside a paper's numbers.\n\n"
    "Trials run inline, many at a time, and every row is kept as soon as it is there: after Ctrl-C the same command goes "
    "on where it was. Makes a Parquet file, one row a trial, and a picture of the same name.\n\n"
    "Examples:\n\n"
    "[bold]zwerm study computation-free-comparison --seeds 20[/bold]\n\n"
    "[bold]zwerm study my-study.toml --seeds 501-1000 --out second-half.parquet[/bold]"
)
COMPARE_HELP: Final = (
    "Compare variants of a scenario, seed by seed: same seeds, same luck, same faults.\n\n"
    "The first variant is what the others are compared with. Makes a table for each metric with the paired difference and "
    "its 95 % interval, a Parquet file with one row a trial, and a figure. After Ctrl-C the same command goes on where it "
    "was.\n\n"
    "Examples:\n\n"
    "[bold]zwerm compare gossip-max --variant often --variant seldom:robots.parameters.every_ticks=5 "
    "--sweep radio.loss=0,0.1,...,0.9 --seeds 20[/bold]\n\n"
    "[bold]zwerm compare my.toml --variants variants.toml --sweep "
    "'faults=none:\\[],crash:\\[{kind=\"crash\", nodes=\\[3], at_s=10.0}]'[/bold]\n\n"
    "[bold]zwerm compare sensor-coverage --variants sensor-coverage-loss --sweep radio.loss+uplink.loss=0,0.5 "
    "--seeds 20 --figure loss.pdf[/bold]"
)

Seeds = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--seeds", metavar="N|FIRST-LAST", help="Seeds 1 to N, or FIRST to LAST, instead of the study's."),
]
Jobs = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option("--jobs", min=1, help="How many trials to run at a time; one a core by default."),
]
Out = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option("--out", metavar="FILE.parquet", help="Where the rows go; runs/NAME.parquet by default."),
]
Retry = Annotated[bool, typer.Option("--retry", help="Run trials again that failed.")]


@contextmanager
def _extra() -> Iterator[None]:
    """Say in one line what is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ZwermError(f"study: needs {error.name}; install it with: pip install 'zwerm[study]'") from None


def study(
    study: Annotated[str, typer.Argument(metavar="STUDY", help="A built-in study (see `zwerm list`) or a TOML file.")],
    seeds: Seeds = None,
    jobs: Jobs = None,
    output: Out = None,
    sets: Sets = None,
    retry: Retry = False,
    as_json: Json = False,
) -> None:
    """Run what is missing of a study, print its table and draw it."""
    with mistakes_in_one_line():
        with _extra():
            from zwerm.study.export import study_json
            from zwerm.study.study_figure import draw_study
            from zwerm.study.study_report import StudyProgress, print_results
            from zwerm.study.study_runner import run_study
            from zwerm.study.tables import load_study, parse_seeds
        loaded = load_study(study)
        chosen = None if seeds is None else parse_seeds(seeds)
        path = output or Path("runs") / f"{loaded.name}.parquet"
        with StudyProgress(err, loaded.name, quiet=as_json) as progress:
            result = run_study(
                loaded, path, seeds=chosen, jobs=jobs, sets=tuple(sets or ()), retry=retry, watcher=progress
            )
        drawn = [draw_study(path.with_suffix(".png"), result.results)] if result.done else []
        if as_json:
            print_json(study_json(result, drawn))
        elif result.done:
            print_results(out, result.results)
            _tell(result, drawn)
    _leave(result)


def compare(
    scenario: ScenarioName,
    variants: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--variant",
            metavar="NAME[:PATH=VALUE,...]",
            help="A variant and what it sets; the others are compared with the first.",
        ),
    ] = None,
    variants_file: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--variants",
            metavar="STUDY",
            help="Take variants from a study, a file or a built-in one; and grid, settings, seeds and metrics that are "
            "not given here.",
        ),
    ] = None,
    sweeps: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--sweep",
            metavar="PATH=VALUE,...",
            help="Compare at each of these values; may be given often. FIRST,SECOND,...,LAST counts in even steps, "
            "PATH+PATH sets both, NAME:[...] names an array or a table.",
        ),
    ] = None,
    seeds: Seeds = None,
    metrics: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option("--metrics", metavar="NAME,...", help="What to compare; by default what is known to matter."),
    ] = None,
    sets: Sets = None,
    inline: Annotated[
        bool, typer.Option("--inline/--processes", help="Run trials in one process each, or every robot in its own.")
    ] = True,
    jobs: Jobs = None,
    output: Out = None,
    figure: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--figure", metavar="FILE", help="Where to draw it: .png, .pdf or .svg; beside the rows by default."
        ),
    ] = None,
    retry: Retry = False,
    as_json: Json = False,
) -> None:
    """Run what is missing of a comparison, print its tables and draw it."""
    with mistakes_in_one_line():
        with _extra():
            from zwerm.compare.comparison import Comparison, make_comparison
            from zwerm.compare.comparison_export import comparison_json
            from zwerm.compare.comparison_figure import check_figure, draw_comparison
            from zwerm.compare.comparison_report import print_comparison
            from zwerm.compare.variants import parse_sweep, parse_variant, split
            from zwerm.study.study_report import StudyProgress
            from zwerm.study.study_runner import run_study
            from zwerm.study.tables import load_study, parse_seeds
        wanted = split(metrics or "")
        planned = make_comparison(
            scenario,
            [parse_variant(each) for each in variants or ()],
            [parse_sweep(each) for each in sweeps or ()],
            wanted,
            None if variants_file is None else load_study(variants_file),
        )
        chosen = None if seeds is None else parse_seeds(seeds)
        path = output or Path("runs") / f"{planned.name}.parquet"
        drawing = check_figure(figure or path.with_suffix(".png"))
        with StudyProgress(err, planned.name, quiet=as_json) as progress:
            result = run_study(
                planned,
                path,
                seeds=chosen,
                jobs=jobs,
                sets=tuple(sets or ()),
                retry=retry,
                runner="inline" if inline else "processes",
                watcher=progress,
            )
        comparison = Comparison(result.results)
        drawn = draw_comparison(drawing, comparison, wanted) if result.done else []
        if as_json:
            print_json(comparison_json(result, comparison, drawn))
        elif result.done:
            print_comparison(out, comparison)
            _tell(result, drawn)
    _leave(result, failing_is_news=False)


def _tell(result: "StudyResult", drawn: list[Path]) -> None:
    ran = f"{result.done} of {result.planned} trials, {result.ran} of them run now: {result.path}"
    err.print(ran, highlight=False, soft_wrap=True)
    for each in drawn:
        err.print(f"picture: {each}", highlight=False, soft_wrap=True)


def _leave(result: "StudyResult", failing_is_news: bool = True) -> NoReturn:
    """Exit with the status that belongs to the result; in a comparison, that runs fail is a result like any other."""
    if result.interrupted:
        err.print("zwerm: interrupted; the same command goes on from here", style="red")
        raise typer.Exit(EXIT_INTERRUPTED)
    raise typer.Exit(EXIT_FAILED if result.failed and failing_is_news else 0)
