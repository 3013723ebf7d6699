"""Entry point of the command line: finds the command by its name, imports only that command's module, and runs it.

Tables that are a command's result go to standard output, progress and errors to standard error. With --json, standard output
is one JSON object. Exit status: 0 success, 1 the run failed, 2 an error in the input, 130 interrupted by Ctrl-C.
"""

import errno
import inspect
import os
import re
import signal
import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Annotated, Any, Final, NoReturn

import typer
from typer.core import TyperGroup

from zwerm.catalogue import COMMANDS
from zwerm.cli.terminal import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_USER_ERROR, err, reserve_stdout
from zwerm.version import __version__

HELP: Final = (
    "Emulate robot swarms as what they are: many processes that pass messages, with bit-identical runs.\n\n"
    "`zwerm my_module:my_command ARGS` runs a command of your own: a typer or click command, or a function with "
    "type annotations, in my_module.py of the current directory or in an installed package."
)

# Errors that a correct program meets on a machine with a full or read-only disk, or with too few descriptors.
_FAULTS_OF_THE_MACHINE: Final = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EMFILE, errno.ENFILE}


class LazyCommands(Mapping[str, Any]):
    """The built-in commands by name. The module of a command is imported when the command is first looked up."""

    def __init__(self) -> None:
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._loaded:
            module, _, function = COMMANDS[name].partition(":")
            single = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
            found = getattr(import_module(module), function)
            text = help_text(found.__doc__)
            single.command(name, help=text, short_help=text.partition("\n\n")[0])(found)
            self._loaded[name] = typer.main.get_command(single)
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


def help_text(docstring: str) -> str:
    """Return a docstring as help: the terminal wraps its paragraphs, but not the commands that are paragraphs."""
    paragraphs = re.sub(r"(?<!\n)\n(?!\n)", " ", inspect.cleandoc(docstring))
    commands = re.sub(r"^\[bold\](.*)\[/bold\]$", r"\b\n    \1", paragraphs, flags=re.MULTILINE)
    return re.sub(r"\[/?bold\]", "`", commands).replace(r"\[", "[")


class LazyGroup(TyperGroup):
    """The group of all built-in commands."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = LazyCommands()


# Without markup: importing what renders it takes more time than all else of the help.
app = typer.Typer(
    name="zwerm",
    cls=LazyGroup,
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=HELP,
)


@app.callback(invoke_without_command=True)
def _root(version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False) -> None:
    if version:
        typer.echo(f"zwerm {__version__}")
        raise typer.Exit


def _interrupt(signum: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def main() -> None:
    """Run the command line. Modules in the current directory are importable: a scenario or a command can name them."""
    try:
        sys.path.insert(0, str(Path.cwd()))
    except FileNotFoundError:
        _exit_without_directory()
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # nohup ignores hang-ups
            signal.signal(number, _interrupt)
    try:
        if ":" in "".join(sys.argv[1:2]):
            from zwerm.cli.user_command import run_user_command

            run_user_command(sys.argv[1], sys.argv[2:])
        else:
            if "--json" in sys.argv:
                reserve_stdout()
            app()
    except KeyboardInterrupt:
        _exit_interrupted()
    except RuntimeError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        _exit_interrupted()  # in the middle of a class statement, while a module is imported
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(EXIT_FAILED)
    except OSError as error:
        if not _has_directory():  # deleted while the command ran
            _exit_without_directory()
        if error.errno not in _FAULTS_OF_THE_MACHINE:
            raise
        place = f"{error.filename}: " if error.filename else ""
        err.print(f"zwerm: {place}{error.strerror}", style="red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(EXIT_USER_ERROR)
    except (ImportError, AttributeError) as error:
        from zwerm.cli.hidden_libraries import hidden_library  # most commands do not need it

        hidden = hidden_library(error)
        if not hidden:
            raise
        err.print(f"zwerm: {hidden}", style="red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(EXIT_USER_ERROR)


def _exit_interrupted() -> NoReturn:
    err.print("zwerm: interrupted", style="red")
    sys.exit(EXIT_INTERRUPTED)


def _has_directory() -> bool:
    try:
        Path.cwd()
    except FileNotFoundError:
        return False
    return True


def _exit_without_directory() -> NoReturn:
    err.print("zwerm: the working directory was deleted; change to another one", style="red")
    sys.exit(EXIT_USER_ERROR)
