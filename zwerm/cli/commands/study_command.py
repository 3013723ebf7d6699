"""`zwerm study`: run a study, print its table and draw it."""

import os
from typing import Annotated, Optional

import typer

from zwerm.cli.options import Json, Sets, built_in_names
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


def study(
    study: Annotated[
        str,
        typer.Argument(
            metavar="STUDY",
            help="A built-in study (see `zwerm list`) or a TOML file.",
            autocompletion=built_in_names("studies"),
        ),
    ],
    seeds: Seeds = None,
    jobs: Jobs = None,
    output: Out = None,
    sets: Sets = None,
    retry: Retry = False,
    timeout: Timeout = None,
    shard: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--shard",
            metavar="I/N",
            help="Run part I of N of the trials, into a file of its own. `auto` for I or N is taken from the environment of "
            "a Slurm array, and for I from that of a Kubernetes indexed job.",
        ),
    ] = None,
    cluster: Annotated[
        str,
        typer.Option(
            "--cluster", metavar="tcp://HOST:PORT", help="Run the trials on the Dask cluster of this scheduler."
        ),
    ] = "",
    as_json: Json = False,
) -> None:
    """Run a study: scenarios over a grid of settings and many seeds, compared with a paper's numbers.

    Trials run inline, many at a time. Each row is stored when its trial ends: after Ctrl-C the same command continues
    where it stopped. Writes a Parquet file, one row a trial, and a picture of the same name.

    Examples:

    [bold]zwerm study computation-free-comparison --seeds 20[/bold]

    [bold]zwerm study my-study.toml --seeds 501-1000 --out second-half.parquet[/bold]

    [bold]zwerm study my-study.toml --shard 3/8[/bold]

    [bold]zwerm study my-study.toml --cluster tcp://10.0.0.5:8786[/bold]
    """
    with errors_as_lines():
        with study_extra():
            from zwerm.study.distribute.shard import parse_shard
            from zwerm.study.export import study_json
            from zwerm.study.study_figure import draw_study
            from zwerm.study.study_report import StudyProgress, print_results
            from zwerm.study.study_runner import run_study
            from zwerm.study.study_tables import load_study, parse_seeds
        loaded = load_study(study)
        chosen = None if seeds is None else parse_seeds(seeds)
        part = None if shard is None else parse_shard(shard, os.environ)
        path = rows_file(output, loaded.name)
        if part is not None and output is None:
            path = part.file(path)
        with StudyProgress(err, loaded.name, quiet=as_json) as progress:
            result = run_study(
                loaded,
                path,
                seeds=chosen,
                jobs=jobs,
                sets=tuple(sets or ()),
                retry=retry,
                timeout_s=timeout,
                listener=progress,
                shard=part,
                cluster=cluster,
            )
        picture = path.with_suffix(".png")
        drawn, problems = write_files(
            (picture, lambda: [draw_study(picture, result.results)] if result.done else []),
            (output, lambda: write_csv(output, result)),
        )
        if as_json:
            print_json(study_json(result, drawn))
        elif result.done:
            print_results(out, result.results)
            print_trial_counts(result, drawn)
        raise_problems(result, problems)
    exit_with(result)
