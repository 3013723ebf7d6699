"""The options that `zwerm run` and `zwerm world` share, as one object that a command takes as its parameter
`options`."""

import inspect
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from typing import TYPE_CHECKING, Any, Final, get_type_hints

from zwerm.cli.options import (
    Animation,
    Bare,
    ColourBy,
    Json,
    Links,
    Picture,
    PictureAt,
    PictureSize,
    Quiet,
    RadioTable,
    RealTime,
    Record,
    ScenarioName,
    SecurityLogFile,
    Seed,
    Sets,
)

if TYPE_CHECKING:  # not above: --help needs none of them
    from zwerm.cli.run_output import RunOutput
    from zwerm.scenario.tables import Scenario

PARAMETER: Final = "options"
# The shared options that --help lists before a command's own.
FIRST: Final = ("scenario", "seed", "sets")


@dataclass(frozen=True)
class RunOptions:
    """A scenario with its settings, and the output of its run."""

    scenario: ScenarioName
    seed: Seed = 1
    sets: Sets = None
    realtime: RealTime = None
    record: Record = None
    security_log: SecurityLogFile = None
    picture: Picture = None
    picture_at: PictureAt = None
    animate: Animation = None
    size: PictureSize = None
    bare: Bare = False
    colour_by: ColourBy = None
    links: Links = None
    radio_table: RadioTable = None
    as_json: Json = False
    quiet: Quiet = False

    def output(self) -> "RunOutput":
        """Return the output of the run. Raises ScenarioError for wrong options."""
        from zwerm.cli.run_output import RunOutput

        return RunOutput(
            self.picture,
            tuple(self.picture_at or ()),
            self.animate,
            self.radio_table,
            self.as_json,
            self.record,
            self.size,
            self.bare,
            self.colour_by,
            self.links,
            self.quiet,
        )

    def load(self) -> "Scenario":
        """Return the scenario with its settings. Raises ScenarioError, also for a picture of a time after its end."""
        from zwerm.errors import ScenarioError
        from zwerm.scenario.load import load

        loaded = load(self.scenario, tuple(self.sets or ()))
        end_s = loaded.time.duration_s
        late = [each for each in self.picture_at or () if each.endswith("s") and float(each[:-1]) > end_s]
        if late:
            raise ScenarioError(
                [f"--picture-at: expected a time of the run, 0 to {end_s:g} s, got {each}" for each in late]
            )
        return loaded

    @property
    def shows_no_progress(self) -> bool:
        """Return whether progress is left out."""
        return self.as_json or self.quiet


def with_run_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the fields of `RunOptions` as options in place of its parameter `options`."""
    shared = fields(RunOptions)
    hints = get_type_hints(command, include_extras=True) | get_type_hints(RunOptions, include_extras=True)
    own = [each for name, each in inspect.signature(command).parameters.items() if name != PARAMETER]

    def parameter(name: str, default: Any) -> inspect.Parameter:
        kept = inspect.Parameter.empty if default is MISSING else default
        return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=kept, annotation=hints[name])

    def called(**given: Any) -> None:
        options = RunOptions(**{each.name: given.pop(each.name) for each in shared})
        command(options, **given)

    given = {each.name: parameter(each.name, each.default) for each in shared}
    first = [given.pop(name) for name in FIRST]
    middle = [parameter(each.name, MISSING if each.default is each.empty else each.default) for each in own]
    every = [*first, *middle, *given.values()]
    called.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
    called.__annotations__ = {each.name: each.annotation for each in every}
    called.__name__, called.__doc__, called.__module__ = command.__name__, command.__doc__, command.__module__
    return called
