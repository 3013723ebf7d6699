"""`zwerm list`: the built-in scenarios and studies."""

from zwerm.cli.terminal import errors_as_lines, out


def list_scenarios() -> None:
    """List the built-in scenarios and studies.

    Example: [bold]zwerm list[/bold]
    """
    from zwerm.cli.console import print_scenarios
    from zwerm.scenario.load import built_in, load
    from zwerm.study.study_report import print_studies
    from zwerm.study.study_tables import built_in as built_in_studies
    from zwerm.study.study_tables import load_study

    with errors_as_lines():
        print_scenarios(out, [load(name) for name in built_in()])
        out.print()
        print_studies(out, [load_study(name) for name in built_in_studies()])
