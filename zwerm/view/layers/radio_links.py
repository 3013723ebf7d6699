"""The layer of radio links: a line between two robots if a packet between them has arrived in this run."""

from collections.abc import Sequence
from typing import ClassVar, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from zwerm.record.history import Tracks
from zwerm.view.canvas import VERMILLION, Sheet
from zwerm.view.layer import Layer
from zwerm.view.run_view import RunView

OPACITY: Final = 0.35
POINTS: Final = 0.9


class RadioLinks(Layer):
    """Straight lines below the robots. A link counts from the first packet to the last one of the run, wherever it
    was."""

    colours: ClassVar[Sequence[str]] = (VERMILLION,)
    more_entries: ClassVar[int] = 1

    def __init__(self, sheet: Sheet, view: RunView, names: bool = False) -> None:
        self._pairs = np.array(view.links, dtype=np.int64).reshape(-1, 2)
        self._lines = LineCollection([], colors=VERMILLION, linewidths=POINTS, alpha=OPACITY, zorder=1.8)
        sheet.axes.add_collection(self._lines, autolim=False)

    @classmethod
    def applies(cls, view: RunView) -> bool:
        """Return whether the run's picture has links, and there are some."""
        return len(view.links) > 0

    @property
    def artists(self) -> Sequence[Artist]:
        """The lines."""
        return (self._lines,)

    def show(self, tracks: Tracks, index: int, at_s: float | None) -> None:
        """Show the links of robots that are in the arena."""
        present = tracks.present[index]
        shown = self._pairs[present[self._pairs].all(axis=1)]
        self._lines.set_segments(list(tracks.position[index][shown]))

    def legend(self) -> Sequence[Line2D | Patch]:
        """Return one entry."""
        return [
            Line2D([], [], color=VERMILLION, alpha=OPACITY, linewidth=1.2, label="packets have arrived in this run")
        ]
