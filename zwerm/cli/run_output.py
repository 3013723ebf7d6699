"""The output of `zwerm run` and `zwerm world`: pictures, an animation, and the result as a table or as JSON."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NoReturn

import typer

from zwerm.cli.console import RunProgress, print_file, print_result
from zwerm.cli.output_files import ANIMATIONS, PICTURES, RECORDINGS, OutputFile, check_outputs, run_stem
from zwerm.cli.radio_table import print_radio_ledger
from zwerm.cli.terminal import EXIT_FAILED, EXIT_INTERRUPTED, err, out, print_json
from zwerm.cli.tracebacks import print_crashes, print_tracebacks
from zwerm.errors import PictureError, ScenarioError, ZwermError
from zwerm.run.result import RunResult

NO_PICTURE: Final = "no picture is drawn: matplotlib is not installed; pip install matplotlib"

_SIZE: Final = re.compile(r"[0-9]+(\.[0-9]+)?x[0-9]+(\.[0-9]+)?")

# Sides of the arena in a picture [inches]. The largest picture takes about 300 MB.
_SIDE_MIN_IN: Final = 0.5
_SIDE_MAX_IN: Final = 50.0
_MOMENT: Final = re.compile(r"(?P<cycle>\d+)|(?P<at_s>\d+(\.\d+)?)s")


@dataclass(frozen=True)
class RunOutput:
    """The output options of a command.

    `radio_table` is the number of links to print, or None for no table. Raises ScenarioError for a moment that is
    neither a cycle nor a time, and for files that cannot be written.
    """

    picture: Path | None
    moments: tuple[str, ...]
    animation: Path | None
    radio_table: int | None
    as_json: bool
    record: Path | None = None
    size: str | None = None
    bare: bool = False
    colour_by: str | None = None
    links: bool | None = None
    quiet: bool = False

    def __post_init__(self) -> None:
        diagnostics = [
            f"--picture-at: expected a cycle such as 40 or a time such as 120s, got {each!r}"
            for each in self.moments
            if not _MOMENT.fullmatch(each)
        ]
        if self.size is not None and not (
            _SIZE.fullmatch(self.size) and all(_SIDE_MIN_IN <= side <= _SIDE_MAX_IN for side in self._style["size_in"])
        ):
            rule = f"WIDTHxHEIGHT in inches, such as 3.4x3, each from {_SIDE_MIN_IN:g} to {_SIDE_MAX_IN:g}"
            diagnostics.append(f"--size: expected {rule}, got {self.size!r:.80}")
        files = [
            OutputFile("--picture", self.picture, PICTURES, "matplotlib", "all"),
            OutputFile("--animate", self.animation, ANIMATIONS, "matplotlib", "all"),
            OutputFile("--record", self.record, RECORDINGS, "mcap", "record"),
        ]
        if self.draws_by_default or self.moments:  # the files that are written without an option
            files.append(OutputFile("runs", Path("runs") / "picture.png", PICTURES))
        try:
            check_outputs(files)
        except ScenarioError as error:
            diagnostics += error.mistakes
        if diagnostics:
            raise ScenarioError(diagnostics)

    @property
    def _style(self) -> dict[str, Any]:
        size = None if self.size is None else tuple(map(float, self.size.split("x")))
        return {"size_in": size, "bare": self.bare, "colour_by": self.colour_by, "links": self.links}

    @property
    def draws_by_default(self) -> bool:
        """Return whether a picture is drawn although no option asks for it."""
        return self.picture is None and not self.as_json

    def report(self, result: RunResult) -> NoReturn:
        """Print the result, then write its files, and exit with the status of its outcome.

        The result comes first: a full disk, or Ctrl-C while a picture is drawn, does not lose it.
        """
        print_tracebacks(err, result.tracebacks)
        print_crashes(err, result)
        if self.as_json:
            print_json(result.as_json())
        else:
            print_result(out, result)
            if self.radio_table is not None:
                print_radio_ledger(out, result.radio, self.radio_table)
            if self.draws_by_default and self._lacks_matplotlib:
                err.print(NO_PICTURE, highlight=False, markup=False, soft_wrap=True)
        if result.reason:
            err.print(f"zwerm: {result.reason}", style="red", markup=False, highlight=False, soft_wrap=True)
        errors = [*result.problems, *self._write_files(result)]
        if errors:
            raise PictureError("\n".join(errors))
        if result.outcome == "interrupted":
            raise typer.Exit(EXIT_INTERRUPTED)
        raise typer.Exit(0 if result.ok else EXIT_FAILED)

    @property
    def _lacks_matplotlib(self) -> bool:
        return find_spec("matplotlib") is None

    def _write_files(self, result: RunResult) -> list[str]:
        """Write pictures, faults and animation, and print the path of each. Return why some cannot be written."""
        path = self.picture or Path("runs") / f"{_stem(result)}.png"
        files: list[Callable[[], Path]] = []
        if self.record is not None and not result.problems:
            files.append(partial(Path, self.record))
        if self.picture is not None or (self.draws_by_default and not self._lacks_matplotlib):
            files.append(lambda: result.picture(path, **self._style))
        files += [partial(_draw_moment, result, path, moment, self._style) for moment in self.moments]
        if result.scenario.random_faults is not None and not self.as_json:
            files.append(lambda: _write_faults(result))
        if self.animation is not None:
            files.append(partial(self._animate, result, self.animation))
        if result.missing_colour and self.colour_by is None and (self.picture or self.animation or not self.as_json):
            hint = f"pictures.colour_by: no robot reported {result.missing_colour!r}; robots have no colours"
            err.print(hint, highlight=False, markup=False, soft_wrap=True)
        errors: list[str] = []
        for write in files:
            try:
                written = write()
            except (ZwermError, OSError) as error:
                errors.append(str(error))
            else:
                if not self.as_json:
                    print_file(out, written)
        return errors

    def _animate(self, result: RunResult, path: Path) -> Path:
        with RunProgress(err, "animation", quiet=self.as_json or self.quiet) as progress:
            return result.animate(path, progress.ticked, **self._style)


def _stem(result: RunResult) -> str:
    return run_stem(result.scenario.name, result.seed, result.scenario.overrides)


def _draw_moment(result: RunResult, final: Path, moment: str, style: dict[str, Any]) -> Path:
    """Draw the run at a moment; the file name is that of the final picture with the moment appended."""
    found = _MOMENT.fullmatch(moment)
    assert found is not None
    if found["cycle"] is not None:
        return result.picture(final.with_stem(f"{final.stem}-cycle{moment}"), cycle=int(moment), **style)
    return result.picture(final.with_stem(f"{final.stem}-{moment}"), at_s=float(found["at_s"]), **style)


def _write_faults(result: RunResult) -> Path:
    """Write the random faults of the run as a scenario's fault tables."""
    from zwerm.scenario.toml import write_toml

    path = Path("runs") / f"{_stem(result)}-faults.toml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(write_toml({"faults": result.faults}), encoding="utf-8")
    return path
