"""The consoles, the exit codes, and how commands print errors and JSON."""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, TextIO

import typer
from rich.console import Console

from zwerm.errors import ZwermError

EXIT_FAILED, EXIT_USER_ERROR, EXIT_INTERRUPTED = 1, 2, 130

# Names such as `zoo:Robot` are no emoji.
err: Final = Console(stderr=True, emoji=False)
out: Final = Console(emoji=False)


@contextmanager
def errors_as_lines() -> Iterator[None]:
    """Print each line of a ZwermError after `zwerm: `, and exit with status 2."""
    try:
        yield
    except ZwermError as error:
        for line in str(error).splitlines():
            err.print(f"zwerm: {line}", style="red", markup=False, highlight=False, soft_wrap=True)
        raise typer.Exit(EXIT_USER_ERROR) from None


def print_json(content: Mapping[str, Any]) -> None:
    """Print one JSON object on one line of standard output. NaN and infinity become null."""
    import msgspec

    stream = _reserved or sys.stdout
    stream.write(msgspec.json.encode(content).decode() + "\n")
    stream.flush()


_reserved: TextIO | None = None


def reserve_stdout() -> None:
    """From now on only `print_json` writes to standard output; all other output to it goes to standard error.

    Processes started later inherit this. A controller or a library that prints does not spoil the JSON object.
    """
    global _reserved
    sys.stdout.flush()
    _reserved = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
