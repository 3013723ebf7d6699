"""A user's own command: `zwerm module:name ARGS` runs a typer or click command, or a function with type annotations."""

import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any, NoReturn

import typer

from zwerm.cli.terminal import errors_as_lines
from zwerm.errors import ZwermError


def run_user_command(name: str, arguments: Sequence[str]) -> NoReturn:
    """Run the command `name`, `module:attribute`, and exit with its status; 2 if there is no such command."""
    try:
        with errors_as_lines():
            runner = command_runner(name)
            runner(args=list(arguments), prog_name=f"zwerm {name}")
    except typer.Exit as error:
        sys.exit(error.exit_code)
    sys.exit(0)


def command_runner(name: str) -> Callable[..., Any]:
    """Return the function that parses arguments and runs the command `name`; it takes `args` and `prog_name`.

    Raises ZwermError, in one line, if the module or its attribute does not exist or is no command.
    """
    module_name, _, attribute = name.partition(":")
    if not module_name or not attribute:
        raise ZwermError(f"{name}: expected a command of your own as module:function")
    if not _exists(module_name):
        raise ZwermError(f"{name}: no module {module_name!r} in this directory or in an installed package")
    try:
        module = import_module(module_name)
    except ImportError as error:
        raise ZwermError(f"{name}: cannot import {module_name!r}: {error}") from error
    found = getattr(module, attribute, None)
    if found is None:
        raise ZwermError(f"{name}: module {module_name!r} has no {attribute!r}")
    if isinstance(found, typer.Typer):
        return found
    # Click is recognised by its method: typer carries a copy of click, whose classes differ from those of the package.
    main: Any = getattr(found, "main", None)
    if callable(main):
        return main  # type: ignore[no-any-return]
    if not callable(found) or isinstance(found, type):
        raise ZwermError(f"{name}: expected a typer or click command or a function, got {type(found).__name__}")
    return _as_app(found)


def _as_app(function: Callable[..., Any]) -> typer.Typer:
    settings = {"help_option_names": ["-h", "--help"]}
    single = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    single.command(context_settings=settings)(function)
    return single


def _exists(module_name: str) -> bool:
    """Return whether a module of this name can be found."""
    try:
        return find_spec(module_name) is not None
    except (ImportError, ValueError):
        return False
