"""The layer that colours robots by a number that they report as telemetry. Colours are eight of viridis."""

from bisect import bisect_right
from collections.abc import Sequence
from typing import ClassVar, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import EllipseCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from zwerm.errors import PictureError
from zwerm.record.history import Tracks
from zwerm.scenario.nearest import did_you_mean
from zwerm.view.canvas import WALL, Sheet
from zwerm.view.layer import Layer
from zwerm.view.run_view import RunView
from zwerm.view.swarm_artists import RADIUS_MIN_FRACTION

# Robots with a colour are drawn a little larger than their bodies, and those without a value stay as they are.
LARGER: Final = 1.35
_AT_END_S: Final = float("inf")


class TelemetryColours(Layer):
    """A disc over each robot, coloured by the newest value of `view.colour_by` that it has reported."""

    colours: ClassVar[Sequence[str]] = (
        *("#440154", "#46327E", "#365C8D", "#277F8E", "#1FA187", "#4AC16D", "#A0DA39", "#FDE725"),
    )
    more_entries: ClassVar[int] = 3

    def __init__(self, sheet: Sheet, view: RunView, names: bool = False) -> None:
        """Take the values of the run. Raises PictureError where no robot has reported that name."""
        known = sorted(set(view.telemetry.name.tolist()))
        if view.colour_by not in known:
            reported = ", ".join(known) or "none"
            expected = f"a name of telemetry that the run has ({reported})"
            hint = did_you_mean(view.colour_by, known)
            raise PictureError(f"colour_by: expected {expected}, got {view.colour_by!r}{hint}")
        self._name = view.colour_by
        chosen = view.telemetry.name == view.colour_by
        self._reports: dict[int, tuple[list[float], list[float]]] = {}
        rows = zip(
            *(getattr(view.telemetry, each)[chosen].tolist() for each in ("node", "time_s", "value")), strict=True
        )
        for node, time_s, value in rows:
            times, values = self._reports.setdefault(node, ([], []))
            times.append(time_s)
            values.append(value)
        found = view.telemetry.value[chosen]
        self._least, self._greatest = float(found.min()), float(found.max())
        self._shown: list[float] = np.unique(found).tolist()
        if len(self._shown) > self.more_entries:
            self._shown = [self._least, (self._least + self._greatest) / 2.0, self._greatest]
        xmin, ymin, xmax, ymax = view.arena.bounds
        radius = LARGER * max(view.radius_m, RADIUS_MIN_FRACTION * max(xmax - xmin, ymax - ymin))
        self._discs = EllipseCollection(
            [2.0 * radius], [2.0 * radius], [0.0], units="xy", offset_transform=sheet.axes.transData, zorder=4.2
        )
        self._discs.set_edgecolor("white")
        sheet.axes.add_collection(self._discs, autolim=False)

    @classmethod
    def applies(cls, view: RunView) -> bool:
        """Return whether the run's picture has a value to colour by."""
        return bool(view.colour_by)

    @property
    def artists(self) -> Sequence[Artist]:
        """The discs."""
        return (self._discs,)

    def show(self, tracks: Tracks, index: int, at_s: float | None) -> None:
        """Show the newest values at a time."""
        moment_s = _AT_END_S if at_s is None else at_s + 1e-9
        places, colours = [], []
        for node, (times, values) in sorted(self._reports.items()):
            newest = bisect_right(times, moment_s) - 1
            if newest >= 0 and node < tracks.present.shape[1] and tracks.present[index][node]:
                places.append(tracks.position[index][node])
                colours.append(self._colour(values[newest]))
        self._discs.set_offsets(np.array(places).reshape(-1, 2))
        self._discs.set_facecolor(colours)

    def _colour(self, value: float) -> str:
        span = self._greatest - self._least
        steps = len(self.colours)
        return self.colours[min(steps - 1, int(steps * (value - self._least) / span)) if span > 0 else 0]

    def legend(self) -> Sequence[Line2D | Patch]:
        """Return all values of a few, else the least, a middle and the greatest."""
        return [
            Line2D([], [], linestyle="none", marker="o", color=self._colour(each), mec=WALL, mew=0.3, label=label)
            for each in self._shown
            for label in [f"{self._name.replace('_', ' ')} is {each:.4g}"]
        ]
