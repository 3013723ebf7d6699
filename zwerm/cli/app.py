"""The command line: `zwerm list`, `check`, `run`, `world`, `robot`, `twin`, `shrink`, `study` and `compare`.

What a command prints for people goes to standard error, but for tables that are its result; with --json standard output is
one JSON object and nothing else. Exit status: 0 as it should be, 1 the run failed, 2 a mistake of the user's, 130 Ctrl-C.
"""

import os
import re
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import Annotated, Literal, NoReturn, Optional

import typer

from zwerm.cli.console import RunProgress, print_result, print_scenarios
from zwerm.cli.options import (
    Animation,
    Json,
    Picture,
    PictureAt,
    RadioTable,
    RealTime,
    Record,
    ScenarioName,
    Seed,
    Sets,
)
from zwerm.cli.radio_table import print_books
from zwerm.cli.terminal import (
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    err,
    mistakes_in_one_line,
    out,
    print_json,
)
from zwerm.cli.trials import COMPARE_HELP, STUDY_HELP, compare, study
from zwerm.errors import PictureError, ScenarioError
from zwerm.run.result import RunResult
from zwerm.scenario.load import built_in, load, locate
from zwerm.version import __version__

app = typer.Typer(
    name="zwerm",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Emulate robot swarms as what they are: many processes that pass messages, with bit-identical runs.",
)


@app.callback(invoke_without_command=True)
def _root(version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False) -> None:
    if version:
        typer.echo(f"zwerm {__version__}")
        raise typer.Exit


@app.command("list", help="List the built-in scenarios and studies.\n\nExample: [bold]zwerm list[/bold]")
def list_scenarios() -> None:
    """Print a table of the built-in scenarios, and one of the studies."""
    from zwerm.study.study_report import print_studies
    from zwerm.study.tables import built_in as built_in_studies
    from zwerm.study.tables import load_study

    with mistakes_in_one_line():
        print_scenarios(out, [load(name) for name in built_in()])
        out.print()
        print_studies(out, [load_study(name) for name in built_in_studies()])


@app.command(
    help="Check scenarios, and report every mistake with its place, the rule and the value.\n\n"
    "Examples: [bold]zwerm check my.toml[/bold], [bold]zwerm check computation-free --set robots.count=30[/bold]"
)
def check(
    scenarios: Annotated[list[str], typer.Argument(help="Built-in names or TOML files.")], sets: Sets = None
) -> None:
    """Load and assemble each scenario without running it."""
    from zwerm.run.validation import scenario_mistakes

    mistakes: list[str] = []
    for name in scenarios:
        found = scenario_mistakes(name, tuple(sets or ()))
        mistakes += found
        if not found:
            out.print(f"{locate(name)}: no mistakes", markup=False, highlight=False, soft_wrap=True)
    if mistakes:
        with mistakes_in_one_line():
            raise ScenarioError(mistakes)


@app.command(
    help="Run a scenario: the world in this process, and every robot in a process of its own.\n\n"
    "Examples:\n\n"
    "[bold]zwerm run computation-free[/bold]\n\n"
    "[bold]zwerm run computation-free --seed 7 --set robots.count=40 --animate swarm.gif[/bold]\n\n"
    "[bold]zwerm run sensor-coverage --picture-at 40 --picture-at 300s --animate swarm.mp4[/bold]\n\n"
    "[bold]zwerm run computation-free --inline --json[/bold]\n\n"
    "[bold]zwerm run computation-free --set robots.controller=my_file:MyController[/bold]"
)
def run(
    scenario: ScenarioName,
    seed: Seed = 1,
    sets: Sets = None,
    inline: Annotated[
        bool, typer.Option("--inline/--processes", help="Run the robots in this process: faster, same trace.")
    ] = False,
    realtime: RealTime = None,
    record: Record = None,
    picture: Picture = None,
    picture_at: PictureAt = None,
    animate: Animation = None,
    radio_table: RadioTable = None,
    as_json: Json = False,
) -> None:
    """Run a scenario and report on it."""
    from zwerm.run.runner import run as run_scenario

    with mistakes_in_one_line():
        _check_moments(picture_at)
        loaded = load(scenario, tuple(sets or ()))
        with RunProgress(err, loaded.name, quiet=as_json) as progress:
            result = run_scenario(
                loaded, seed, "inline" if inline else "processes", realtime=realtime, watcher=progress, record=record
            )
        _report(result, picture, picture_at or [], animate, radio_table, as_json)


@app.command(
    help="Run the world of a scenario and wait for robots on other machines to connect.\n\n"
    "Writes the robots' credentials to a file that only you can read; carry it to where the robots run.\n\n"
    "Example: [bold]zwerm world computation-free --listen tcp/0.0.0.0:7447 --credentials robots.key[/bold]"
)
def world(
    scenario: ScenarioName,
    listen: Annotated[list[str], typer.Option("--listen", help="A Zenoh endpoint, such as tcp/0.0.0.0:7447.")],
    credentials: Annotated[Path, typer.Option("--credentials", help="The file to write the robots' credentials to.")],
    seed: Seed = 1,
    sets: Sets = None,
    realtime: RealTime = None,
    record: Record = None,
    picture: Picture = None,
    picture_at: PictureAt = None,
    animate: Animation = None,
    radio_table: RadioTable = None,
    as_json: Json = False,
) -> None:
    """Run a world whose robots are started elsewhere."""
    from zwerm.run.runner import serve

    with mistakes_in_one_line():
        _check_moments(picture_at)
        loaded = load(scenario, tuple(sets or ()))
        with RunProgress(err, loaded.name, quiet=as_json) as progress:
            result = serve(loaded, seed, listen, credentials, realtime=realtime, watcher=progress, record=record)
        _report(result, picture, picture_at or [], animate, radio_table, as_json)


@app.command(
    help="Run robots that connect to a world elsewhere.\n\n"
    "Example: [bold]zwerm robot --connect tcp/192.0.2.1:7447 --credentials robots.key --ids 0-24[/bold]"
)
def robot(
    connect: Annotated[str, typer.Option("--connect", help="The world's Zenoh endpoint.")],
    credentials: Annotated[Path, typer.Option("--credentials", help="The file that `zwerm world` wrote.")],
    ids: Annotated[str, typer.Option("--ids", help="The robots to run here: 3, 0-24 or 0-4,10-14.")] = "",
) -> None:
    """Start a slice of a swarm's robots on this machine, each in a process of its own."""
    from zwerm.deploy.remote import run_robots

    with mistakes_in_one_line():
        with RunProgress(err, "swarm") as progress:
            codes = run_robots(connect, credentials, ids, progress.joined)
        failed = {node: code for node, code in codes.items() if code}
        for node, code in sorted(failed.items()):
            err.print(f"zwerm: node {node} ended with exit code {code}", style="red", markup=False, highlight=False)
        raise typer.Exit(EXIT_FAILED if failed else 0)


@app.command(
    help="Reduce a failing schedule of faults to a smallest one that still fails, and write it as a scenario.\n\n"
    "Example: [bold]zwerm shrink my.toml --seed 7 --failing 'cell_coverage_fraction < 0.5'[/bold]"
)
def shrink(
    scenario: ScenarioName,
    failing: Annotated[str, typer.Option("--failing", metavar="CONDITION", help="Such as 'METRIC < 0.5'.")],
    seed: Seed = 1,
    sets: Sets = None,
    output: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--out", metavar="FILE.toml", help="Where to write it; runs/SCENARIO-shrunk.toml by default."),
    ] = None,
) -> None:
    """Shrink, and say which faults it takes."""
    from zwerm.run.shrinking import Shrinker, parse_failing, tables_of, with_faults
    from zwerm.scenario.toml import write_toml

    with mistakes_in_one_line():
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


@app.command(
    help="Run a scenario on a real network, in real time: every robot in a network namespace of its own, and every packet over "
    "Zenoh through nftables and tc, which lose and delay what the scenario's models say. The models judge the same packets; "
    "what became of them is set side by side. Needs Linux and root; leaves nothing behind.\n\n"
    "Examples:\n\n"
    "[bold]zwerm twin beacon-twin[/bold]\n\n"
    "[bold]zwerm twin gossip-max --transport tcp --set robots.count=8 --set time.duration_s=10 --json[/bold]"
)
def twin(
    scenario: ScenarioName,
    seed: Seed = 1,
    sets: Sets = None,
    transport: Annotated[
        Literal["udp", "tcp", "both"],
        typer.Option("--transport", help="What Zenoh runs over; both are two runs, one after the other."),
    ] = "both",
    as_json: Json = False,
) -> None:
    """Run a scenario's twin, and print where the models and the network agree."""
    from zwerm.twin.transports import Transports, run_and_tell

    with mistakes_in_one_line():
        loaded = load(scenario, tuple(sets or ()))
        outcomes = run_and_tell(
            loaded,
            seed,
            Transports(transport).chosen(),
            as_json,
            out,
            err,
            lambda name: RunProgress(err, name, quiet=as_json),
        )
    raise typer.Exit(EXIT_INTERRUPTED if "interrupted" in outcomes else EXIT_FAILED if "failed" in outcomes else 0)


app.command(help=STUDY_HELP)(study)
app.command(help=COMPARE_HELP)(compare)


def _report(
    result: RunResult,
    picture: Path | None,
    moments: list[str],
    animate: Path | None,
    radio_table: int | None,
    as_json: bool,
) -> NoReturn:
    """Draw, print, and exit with the status that belongs to the outcome."""
    drawn: list[Path] = []
    mistakes: list[str] = []
    usual = Path("runs") / f"{result.scenario.name}-seed{result.seed}.png"
    if picture is not None or not as_json:
        drawn.append(result.picture(picture or usual))
    for moment in moments:
        # A run is not thrown away for a moment that it does not have.
        try:
            drawn.append(_draw_moment(result, picture or usual, moment))
        except PictureError as error:
            mistakes.append(str(error))
    if result.scenario.random_faults is not None and not as_json:
        from zwerm.scenario.toml import write_toml

        drawn.append(Path("runs") / f"{result.scenario.name}-seed{result.seed}-faults.toml")
        drawn[-1].parent.mkdir(exist_ok=True)
        drawn[-1].write_text(write_toml({"faults": result.faults}), encoding="utf-8")
    if animate is not None:
        with RunProgress(err, "animation", quiet=as_json) as progress:
            drawn.append(result.animate(animate, progress.ticked))
    for node, traceback in sorted(result.tracebacks.items()):
        err.print(f"node {node} raised:\n{traceback}", markup=False, highlight=False, soft_wrap=True)
    if as_json:
        print_json(result.as_json())
    else:
        print_result(out, result, drawn)
        if radio_table is not None:
            print_books(out, result.radio, radio_table)
    if mistakes:
        raise PictureError("\n".join(mistakes))
    if result.reason:
        err.print(f"zwerm: {result.reason}", style="red", markup=False, highlight=False, soft_wrap=True)
    if result.outcome == "interrupted":
        raise typer.Exit(EXIT_INTERRUPTED)
    raise typer.Exit(0 if result.ok else EXIT_FAILED)


_MOMENT = re.compile(r"(?P<cycle>\d+)|(?P<at_s>\d+(\.\d+)?)s")


def _check_moments(moments: list[str] | None) -> None:
    """Raise ScenarioError for what is neither a cycle nor a time."""
    mistakes = [
        f"--picture-at: expected a cycle such as 40 or a time such as 120s, got {each!r}"
        for each in moments or []
        if not _MOMENT.fullmatch(each)
    ]
    if mistakes:
        raise ScenarioError(mistakes)


def _draw_moment(result: RunResult, beside: Path, moment: str) -> Path:
    """Draw a run at a moment, in a file named after the one of its end, and return the path."""
    found = _MOMENT.fullmatch(moment)
    assert found is not None
    if found["cycle"] is not None:
        return result.picture(beside.with_stem(f"{beside.stem}-cycle{moment}"), cycle=int(moment))
    return result.picture(beside.with_stem(f"{beside.stem}-{moment}"), at_s=float(found["at_s"]))


def _interrupt(signum: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def main() -> None:
    """Run the command line, with the current directory importable, so that it can name a controller of the user's."""
    sys.path.insert(0, str(Path.cwd()))
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        app()
    except KeyboardInterrupt:
        err.print("zwerm: interrupted", style="red")
        sys.exit(EXIT_INTERRUPTED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
