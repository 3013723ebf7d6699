"""A user's own command: `zwerm module:name ARGS`, from a file in the working directory."""

import subprocess
import sys
from pathlib import Path

import pytest
from command_line import zwerm
from support import ROOT

COMMANDS = '''
import typer

from zwerm.errors import ScenarioError

app = typer.Typer()
not_a_command = 3


def add(first: int, second: int, scale: float = 1.0) -> None:
    """Add two numbers."""
    print((first + second) * scale)


@app.command()
def greet(name: str) -> None:
    print(f"hello {name}")


@app.command()
def leave() -> None:
    raise typer.Exit(7)


def refuse() -> None:
    raise ScenarioError(["my.toml: robots.count: expected >= 1, got 0"])


class Interrupting:
    def __set_name__(self, owner, name):
        raise KeyboardInterrupt


def load() -> None:
    class Loaded:
        attribute = Interrupting()
'''


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "my_commands.py").write_text(COMMANDS)
    (tmp_path / "broken.py").write_text("import no_such_package\n")
    return tmp_path


def test_a_function_with_annotations_runs_as_a_command(folder: Path) -> None:
    ran = zwerm("my_commands:add", "2", "3", "--scale", "2.0", cwd=folder)
    assert (ran.returncode, ran.stdout) == (0, "10.0\n"), ran.stderr
    wrong = zwerm("my_commands:add", "2", "three", cwd=folder)
    assert wrong.returncode == 2
    assert "Invalid value for" in wrong.stderr
    assert "second" in wrong.stderr.partition("Invalid value for")[2]


@pytest.mark.parametrize("option", ["-h", "--help"])
def test_a_function_that_runs_as_a_command_has_help(folder: Path, option: str) -> None:
    ran = zwerm("my_commands:add", option, cwd=folder)
    assert ran.returncode == 0, ran.stderr
    assert "Usage: zwerm my_commands:add" in ran.stdout
    assert "Add two numbers." in ran.stdout


def test_a_typer_app_runs_with_its_own_subcommands_and_exit_status(folder: Path) -> None:
    assert zwerm("my_commands:app", "greet", "swarm", cwd=folder).stdout == "hello swarm\n"
    assert zwerm("my_commands:app", "leave", cwd=folder).returncode == 7


def test_a_click_command_runs(folder: Path) -> None:
    pytest.importorskip("click")
    (folder / "clicked.py").write_text(
        "import click\n\n\n@click.command()\n@click.option('--count', type=int)\ndef command(count):\n    print(2 * count)\n"
    )
    ran = zwerm("clicked:command", "--count", "4", cwd=folder)
    assert (ran.returncode, ran.stdout) == (0, "8\n"), ran.stderr


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("my_file:add", "my_file:add: no module 'my_file' in this directory or in an installed package"),
        ("my_commands:subtract", "my_commands:subtract: module 'my_commands' has no 'subtract'"),
        (
            "my_commands:not_a_command",
            "my_commands:not_a_command: expected a typer or click command or a function, got int",
        ),
        ("broken:run", "broken:run: cannot import 'broken': No module named 'no_such_package'"),
        (":add", ":add: expected a command of your own as module:function"),
        ("my_commands:refuse", "my.toml: robots.count: expected >= 1, got 0"),
    ],
)
def test_an_error_of_a_user_command_is_one_line_and_status_2(folder: Path, name: str, line: str) -> None:
    ran = zwerm(name, cwd=folder)
    assert (ran.returncode, ran.stdout, ran.stderr) == (2, "", f"zwerm: {line}\n")


def test_help_describes_user_commands() -> None:
    assert "zwerm my_module:my_command ARGS" in zwerm("--help").stdout


LOADED = """
import contextlib, io, sys
from zwerm.cli.app import app
with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.suppress(SystemExit):
    app(sys.argv[1:])
assert printed.getvalue()
print(*(name for name in ("numpy", "pydantic", "zenoh", "zwerm.run", "zwerm.study", "zwerm.world") if name in sys.modules))
"""


def loaded_by(*arguments: str) -> list[str]:
    """Return which large packages and rooms the command line has imported after these arguments."""
    command = [sys.executable, "-c", LOADED, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()


def test_help_imports_no_other_room_and_a_command_imports_what_it_needs() -> None:
    assert loaded_by("--help") == []
    assert "numpy" in loaded_by("check", "computation-free")


def test_an_interrupt_in_the_middle_of_a_class_statement_is_an_interrupt(folder: Path) -> None:
    ran = zwerm("my_commands:load", cwd=folder)
    assert (ran.returncode, ran.stderr) == (130, "zwerm: interrupted\n")
