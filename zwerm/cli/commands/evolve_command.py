"""`zwerm evolve`: search the parameters of a controller by evolution in batches of arenas."""

from pathlib import Path
from typing import Annotated, Optional

import typer

from zwerm.cli.options import Json, Quiet, ScenarioName, Sets
from zwerm.cli.output_files import OutputFile, check_outputs
from zwerm.cli.terminal import EXIT_INTERRUPTED, err, errors_as_lines, out, print_json


def evolve(
    scenario: ScenarioName,
    runs: Annotated[int, typer.Option("--runs", min=1, help="Independent runs, each from a random start.")] = 50,
    generations: Annotated[int, typer.Option("--generations", min=1, help="Generations of each run.")] = 500,
    population: Annotated[int, typer.Option("--population", min=4, help="Candidates of a generation.")] = 12,
    trials: Annotated[int, typer.Option("--trials", min=1, help="Arenas in which each candidate is judged.")] = 20,
    final_trials: Annotated[
        int, typer.Option("--final-trials", min=1, help="Arenas for the last candidates of each run.")
    ] = 200,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Keys the starts, the search and the arenas.")] = 1,
    jobs: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option("--jobs", min=1, help="The number of runs that advance at a time; by default one per core."),
    ] = None,
    output: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--out", metavar="FILE.toml", help="The study to write; runs/SCENARIO-evolved.toml by default."),
    ] = None,
    sets: Sets = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Search the parameters of a controller by evolution (CMA-ES), in batches of arenas of one compiled kernel.

    Every number of the controller that has a least and a greatest value is searched. Fitness is the cell coverage over time.
    Each generation is stored in a journal when it ends: after Ctrl-C the same command continues, and with more --runs or
    --generations it goes on from there. Writes a study that runs the best controller on the emulator, and a picture of the
    fitness.

    Examples:

    [bold]zwerm evolve computation-free --runs 4 --generations 60[/bold]

    [bold]zwerm evolve computation-free --set robots.count=40 --out forty.toml[/bold]
    """
    from os import cpu_count

    from zwerm.evolve.evolution import Evolution, EvolutionSettings
    from zwerm.evolve.evolution_report import (
        EvolutionProgress,
        draw_evolution,
        evolution_json,
        print_evolution,
        write_study,
    )
    from zwerm.evolve.journal import Journal
    from zwerm.scenario.load import load

    with errors_as_lines():
        loaded = load(scenario, tuple(sets or ()))
        path = output or Path("runs") / f"{loaded.name}-evolved.toml"
        check_outputs([OutputFile("--out", path, (".toml",))])
        settings = EvolutionSettings(runs, generations, population, trials, final_trials, seed)
        evolution = Evolution(loaded, settings)
        with (
            Journal(path.with_suffix(".jsonl"), evolution.identity()) as journal,
            EvolutionProgress(err, loaded.name, quiet=quiet or as_json) as progress,
        ):
            result = evolution.run(journal, jobs or cpu_count() or 1, progress)
        files: list[Path] = []
        if result is not None:
            files = [write_study(path, loaded, result), draw_evolution(path.with_suffix(".png"), loaded, result)]
            if as_json:
                print_json(evolution_json(result, settings, files))
            else:
                print_evolution(out, result)
                err.print(f"picture: {files[1]}", highlight=False, soft_wrap=True)
                err.print(f"on the emulator: zwerm study {path}", highlight=False, soft_wrap=True)
    if result is None or result.interrupted:
        err.print("zwerm: interrupted; the same command goes on from here", style="red")
        raise typer.Exit(EXIT_INTERRUPTED)
