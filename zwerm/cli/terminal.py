"""What all commands share: where they print, how they print mistakes and JSON, and with which status they exit."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

import msgspec
import typer
from rich.console import Console

from zwerm.errors import ZwermError

EXIT_FAILED, EXIT_MISTAKE, EXIT_INTERRUPTED = 1, 2, 130

err: Final = Console(stderr=True)
out: Final = Console()


@contextmanager
def mistakes_in_one_line() -> Iterator[None]:
    """Print a user's mistakes as they are, one line each, and exit with status 2."""
    try:
        yield
    except ZwermError as error:
        for line in str(error).splitlines():
            err.print(f"zwerm: {line}", style="red", markup=False, highlight=False, soft_wrap=True)
        raise typer.Exit(EXIT_MISTAKE) from None


def print_json(found: Mapping[str, Any]) -> None:
    """Print one JSON object on a line of its own on standard output; what is not a number is null."""
    sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
    sys.stdout.flush()
