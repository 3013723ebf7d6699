"""`zwerm list`: the catalogue of algorithms with their scenarios and studies, and of plug-ins."""

from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.padding import Padding
from rich.text import Text

from zwerm.catalogue import ALGORITHMS, Algorithm, plugins, row_of, shipped
from zwerm.cli.terminal import errors_as_lines, out, print_json

if TYPE_CHECKING:
    from collections.abc import Sequence


def list_catalogue(
    text: Annotated[
        str, typer.Argument(help="Show only entries with this text in their name or summary, in full.")
    ] = "",
    whole: Annotated[bool, typer.Option("--all", help="Show every scenario and study with its summary.")] = False,
    kinds: Annotated[bool, typer.Option("--plugins", help="List the plug-ins of each kind instead.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """List the algorithms that ship with Zwerm, with their scenarios and studies.

    Examples: [bold]zwerm list[/bold], [bold]zwerm list loss[/bold], [bold]zwerm list --all[/bold], \
[bold]zwerm list --plugins[/bold]
    """
    if kinds:
        if as_json:
            print_json({kind: dict(rows) for kind, rows in plugins().items()})
            return
        for kind, rows in plugins().items():
            out.print(f"[bold]{kind}[/bold]: {', '.join(name for name in rows if text in name)}", highlight=False)
    elif not (text or whole or as_json):
        _print_names()
    else:
        with errors_as_lines():
            algorithms = _algorithms(text)
        if as_json:
            print_json({"algorithms": algorithms})
        else:
            _print_algorithms(algorithms, whole=bool(text))


def _print_names() -> None:
    """Print each algorithm with the names of its scenarios and the number of its studies; reads no file."""
    scenarios, studies = shipped("scenarios"), shipped("studies")
    for row in (*ALGORITHMS, None):
        own = [name for name, file in scenarios.items() if row_of(file) is row]
        count = sum(row_of(file) is row for file in studies.values())
        if own or count:
            title = "Others" if row is None else row.title
            with_studies = f", {count} {'study' if count == 1 else 'studies'}" if count else ""
            out.print(f"[bold]{title}[/bold][dim]{with_studies}[/dim]", highlight=False)
            out.print(Padding(Text(" ".join(own), style="cyan"), (0, 0, 0, 2)))
    out.print(
        "\nzwerm list TEXT, zwerm list --all: with summaries   zwerm show NAME: the file\n"
        "zwerm run NAME: run it   zwerm new DIR: a project of your own",
        highlight=False,
        style="dim",
    )


def _algorithms(text: str) -> "list[dict[str, Any]]":
    """Return the rows with their scenarios and studies that contain `text`; rows without any are left out."""
    from zwerm.scenario.load import built_in, load
    from zwerm.study.study_tables import built_in as built_in_studies
    from zwerm.study.study_tables import load_study

    entries: list[tuple[Algorithm | None, dict[str, Any]]] = []
    for name, file in built_in().items():
        scenario = load(name)
        count = scenario.robots.count
        size = f"{count} robot{'' if count == 1 else 's'}, {scenario.time.duration_s:g} s"
        entry = {"kind": "scenario", "name": name, "size": size, "summary": scenario.summary}
        entries.append((row_of(file), entry))
    for name, file in built_in_studies().items():
        study = load_study(name)
        size = f"{study.trials} trials"
        entries.append((row_of(file), {"kind": "study", "name": name, "size": size, "summary": study.table.summary}))
    chosen = [(row, each) for row, each in entries if text in each["name"] or text.lower() in each["summary"].lower()]
    rows = []
    for row in (*ALGORITHMS, None):
        own = [each for owner, each in chosen if owner is row]
        if own:
            title, paper = ("Others", "") if row is None else (row.title, row.paper)
            rows.append({"name": row.name if row else "", "title": title, "paper": paper, "entries": own})
    return rows


def _print_algorithms(rows: "Sequence[dict[str, Any]]", whole: bool) -> None:
    """Print the rows: the `whole` of each entry, or one line an entry, so that the catalogue fits on a screen or
    two."""
    from rich.table import Table

    for row in rows:
        table = Table(
            box=None, padding=(0, 2, 0, 0), title_justify="left", show_header=False, title_style="bold", expand=True
        )
        table.title = row["title"] + (f" ({row['paper']})" if row["paper"] else "")
        table.add_column(style="cyan", no_wrap=True)
        table.add_column(style="dim", no_wrap=True)
        table.add_column(ratio=1, no_wrap=not whole, overflow="fold" if whole else "ellipsis")
        for each in row["entries"]:
            table.add_row(each["name"], each["size"] if whole else each["kind"], each["summary"])
        out.print(table)
        out.print()
    if not rows:
        out.print("nothing in the catalogue has this text", highlight=False)
