"""`zwerm compare`: run variants of a scenario, print their paired differences and draw them."""

from pathlib import Path
from typing import Annotated, Optional

import typer

from zwerm.cli.options import Json, ScenarioName, Sets
from zwerm.cli.output_files import PICTURES, OutputFile, check_outputs
from zwerm.cli.terminal import err, errors_as_lines, out, print_json
from zwerm.cli.trials import (
    Jobs,
    Out,
    Retry,
    Seeds,
    Timeout,
    exit_with,
    print_trial_counts,
    raise_problems,
    rows_file,
    study_extra,
    write_csv,
    write_files,
)


def compare(
    scenario: ScenarioName,
    variants: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--variant",
            metavar="NAME[:PATH=VALUE,...]",
            help="A variant and its settings; the others are compared with the first.",
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
        typer.Option(
            "--metrics", metavar="NAME,...", help="Metrics to compare; by default a choice of those measured."
        ),
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
            "--figure",
            metavar="FILE",
            help="The file of the figure: .png, .pdf or .svg; by default beside the file of rows.",
        ),
    ] = None,
    retry: Retry = False,
    timeout: Timeout = None,
    as_json: Json = False,
) -> None:
    """Compare variants of a scenario, seed by seed: same seeds, same random draws, same faults.

    The first variant is the reference. Prints for each metric the paired difference and its 95 % interval; writes a
    Parquet file with one row a trial, and a figure. After Ctrl-C the same command continues where it stopped.

    Examples:

    [bold]zwerm compare gossip-max --variant often --variant seldom:robots.parameters.every_ticks=5 \
--sweep radio.loss=0,0.1,...,0.9 --seeds 20[/bold]

    [bold]zwerm compare my.toml --variants variants.toml --sweep \
'faults=none:\\[],crash:\\[{kind="crash", nodes=\\[3], at_s=10.0}]'[/bold]

    [bold]zwerm compare sensor-coverage --variants sensor-coverage-loss --sweep radio.loss+uplink.loss=0,0.5 \
--seeds 20 --figure loss.pdf[/bold]
    """
    with errors_as_lines():
        with study_extra():
            from zwerm.compare.comparison import Comparison, make_comparison
            from zwerm.compare.comparison_export import comparison_json
            from zwerm.compare.comparison_figure import draw_comparison
            from zwerm.compare.comparison_report import print_comparison
            from zwerm.compare.variants import parse_sweep, parse_variant, split
            from zwerm.study.study_report import StudyProgress
            from zwerm.study.study_runner import run_study
            from zwerm.study.study_tables import load_study, parse_seeds
        wanted = split(metrics or "")
        planned = make_comparison(
            scenario,
            [parse_variant(each) for each in variants or ()],
            [parse_sweep(each) for each in sweeps or ()],
            wanted,
            None if variants_file is None else load_study(variants_file),
        )
        chosen = None if seeds is None else parse_seeds(seeds)
        path = rows_file(output, planned.name)
        check_outputs([OutputFile("--figure", figure, PICTURES)])
        drawing = figure or path.with_suffix(".png")
        with StudyProgress(err, planned.name, quiet=as_json) as progress:
            result = run_study(
                planned,
                path,
                seeds=chosen,
                jobs=jobs,
                sets=tuple(sets or ()),
                retry=retry,
                timeout_s=timeout,
                runner="inline" if inline else "processes",
                listener=progress,
            )
        comparison = Comparison(result.results)
        drawn, problems = write_files(
            (drawing, lambda: draw_comparison(drawing, comparison, wanted) if result.done else []),
            (output, lambda: write_csv(output, result)),
        )
        if as_json:
            print_json(comparison_json(result, comparison, drawn))
        elif result.done:
            print_comparison(out, comparison)
            print_trial_counts(result, drawn)
        raise_problems(result, problems)
    exit_with(result, failed_trials_count=False)
