"""Picture layers: drawings of an algorithm or a user over the arena, below the robots.

A layer is a plug-in of one class. The catalogue names the layers of each algorithm; `module:Class` names a user's own.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Protocol

from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from zwerm.record.history import Tracks
from zwerm.view.canvas import Sheet
from zwerm.view.run_view import RunView
from zwerm.world.scene import Bools, Floats


class Stage(Protocol):
    """A numbered stage of an algorithm, with the positions of all robots at that time."""

    @property
    def number(self) -> int | None:
        """The number by which a user asks for the stage."""

    @property
    def time_s(self) -> float:
        """Virtual time [s]."""

    @property
    def position(self) -> Floats:
        """(n, 2) positions [m]."""

    @property
    def present(self) -> Bools:
        """(n,) whether each robot is in the arena."""


class Layer(ABC):
    """Draws on one sheet; `names` asks for labels that suit a still picture. The base class of the plug-in kind
    `layer`."""

    # Colours that the palette of an animation keeps.
    colours: ClassVar[Sequence[str]] = ()
    # Rows that the legend needs at most.
    legend_entries: ClassVar[int] = 0
    # Rows of the legend that this layer adds to those of the swarm and of other layers.
    more_entries: ClassVar[int] = 0
    # Duration of an animation [s], or None for the default.
    animation_s: ClassVar[float | None] = None
    # Metrics that are written above a picture, instead of all.
    headline: ClassVar[Sequence[str]] = ()
    # Name of the layer's stages: the label of the axis below the picture.
    stage_name: ClassVar[str] = "stage"
    # The robots are drawn without paths and noses, so that the layer stays visible.
    plain_swarm: ClassVar[bool] = False

    @abstractmethod
    def __init__(self, sheet: Sheet, view: RunView, names: bool = False) -> None:
        """Add the layer's artists, empty, to the axes of `sheet`."""

    @classmethod
    def applies(cls, view: RunView) -> bool:
        """Return whether this run has anything to draw in this layer."""
        return True

    @classmethod
    def stages(cls, view: RunView) -> Sequence[Stage]:
        """Return the numbered stages of the run, in order of time."""
        return ()

    @property
    @abstractmethod
    def artists(self) -> Sequence[Artist]:
        """The artists that `show` changes."""

    @abstractmethod
    def show(self, tracks: Tracks, index: int, at_s: float | None) -> None:
        """Show the state at sample `index` of the tracks: at time `at_s` [s], or at the end of the run where it is
        None."""

    @abstractmethod
    def legend(self) -> Sequence[Line2D | Patch]:
        """Return the entries of the legend."""
