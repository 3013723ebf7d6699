"""A run on a sheet: the swarm, its layers, the coverage curve, and the text above them."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Final

from zwerm.errors import PictureError
from zwerm.record.history import Tracks
from zwerm.scenario.plugin_names import class_named
from zwerm.view.canvas import Sheet, readable
from zwerm.view.coverage_curve import CoverageCurve, coverage_curve
from zwerm.view.layer import Layer, Stage
from zwerm.view.run_view import RunView
from zwerm.view.swarm_artists import Swarm, gone_at_the_end
from zwerm.world.metrics.sight import SeenArea, hexagonal_packing_robots
from zwerm.world.tick.telemetry import PREFIX

NO_BREAK: Final = "\N{NO-BREAK SPACE}"
UNITS: Final = {"_m_s": " m/s", "_m2": " m²", "_m": " m", "_s": " s"}


class Composition:
    """Everything to draw of one run: the layers that apply to it, its stages, and its coverage over time."""

    def __init__(self, view: RunView) -> None:
        self.view = view
        self.layers: list[type[Layer]] = [kind for kind in map(layer_class, view.layers) if kind.applies(view)]

    @cached_property
    def stages(self) -> Sequence[Stage]:
        """The numbered stages of the first layer that has some."""
        return next((stages for kind in self.layers if (stages := kind.stages(self.view))), ())

    @property
    def plain_swarm(self) -> bool:
        """True if a layer asks for robots without paths and noses."""
        return any(kind.plain_swarm for kind in self.layers)

    @property
    def _stage_name(self) -> str:
        return next((kind.stage_name for kind in self.layers if kind.stage_name), "stage")

    @property
    def _stage_word(self) -> str:
        return self._stage_name.split()[-1]

    @cached_property
    def curve(self) -> CoverageCurve | None:
        """The covered fraction over stages or time, where it was measured."""
        view = self.view
        ideal = None if view.sight_range_m is None else hexagonal_packing_robots(view.arena, view.sight_range_m)
        numbers = [(each.time_s, each.number or 0) for each in self.stages]
        return coverage_curve(view.series, numbers, self._stage_name, ideal)

    def stage(self, number: int) -> Stage:
        """Return the stage of a number. Raises PictureError where the run reported none with it."""
        for each in self.stages:
            if each.number == number:
                return each
        known = f"{self.stages[0].number} to {self.stages[-1].number}" if self.stages else "none"
        raise PictureError(f"{self._stage_word} {number}: expected one that the run reported, which are {known}")

    def legend_entries(self, tracks: Tracks | None = None) -> int:
        """Return the number of entries that the legend needs at most; of a still with `tracks`, else of an
        animation."""
        more = sum(kind.more_entries for kind in self.layers)
        own = max((kind.legend_entries for kind in self.layers), default=0)
        if own or len([kind for kind in self.layers if not kind.more_entries]):
            return own + more
        if tracks is None:
            return 4 + more
        view = self.view
        gone = len(gone_at_the_end(tracks))
        return 3 + gone + (view.coverage_radius_m is not None) + (view.cells is not None) + more

    def draw(self, sheet: Sheet, tracks: Tracks, names: bool = False) -> tuple[Swarm, list[Layer]]:
        """Put the swarm and the layers on the sheet; nothing is shown before their `show`."""
        view = self.view
        layers = [kind(sheet, view, names) for kind in self.layers]
        sight = None if view.sight_range_m is None else SeenArea(view.arena, view.sight_range_m)
        swarm = Swarm(
            sheet,
            view.arena,
            tracks,
            view.radius_m,
            view.coverage_radius_m,
            view.cells,
            sight,
            view.bases,
            self.plain_swarm,
        )
        return swarm, layers

    def moment_in_words(self, tracks: Tracks, index: int, at_s: float | None) -> str:
        """Return the stage, the number of robots, and the covered fraction of one moment."""
        robots = int((tracks.present & ~tracks.dead)[index].sum())
        until = [each for each in self.stages if at_s is None or each.time_s <= at_s + 1e-9]
        words = [f"{self._stage_word} {until[-1].number}"] if until else []
        words.append(f"{robots} robot{'' if robots == 1 else 's'}")
        if self.curve is not None:
            words.append(f"{100.0 * self.curve.at(float(tracks.time_s[index]))[1]:.1f} % in sight")
        return "   ".join(each.replace(" ", NO_BREAK) for each in words)

    def metrics_in_words(self, metrics: Mapping[str, float]) -> str:
        """Return metrics on one line: fractions in percent, other numbers with the unit that their names end in.

        A layer's headline replaces the whole list where the run has its first metric. Telemetry is left to the table.
        """
        headline = next((kind.headline for kind in self.layers if kind.headline), ())
        rest = tuple(name for name in metrics if not name.startswith(PREFIX))
        chosen = headline if headline and headline[0] in metrics else rest
        words = []
        for name, value in ((name, metrics[name]) for name in chosen if name in metrics):
            if name.endswith("_fraction"):
                shown = f"{100.0 * value:.1f} %"
            else:
                unit = next((unit for suffix, unit in UNITS.items() if name.endswith(suffix)), "")
                shown = f"{value:.4g}{unit}"
            words.append(f"{readable(name)} {shown}".replace(" ", NO_BREAK))
        return "   ".join(words)


def layer_class(name: str) -> type[Layer]:
    """Return the layer `module:Class`. Raises PictureError, in one line, where there is none."""
    try:
        found = class_named(name, "layer", ())
    except ValueError as error:
        raise PictureError(str(error)) from None
    if not issubclass(found, Layer):
        raise PictureError(f"{name} is no picture layer: expected a subclass of zwerm.Layer")
    return found
