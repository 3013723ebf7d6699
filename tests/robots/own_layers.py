"""A picture layer as a user would write it."""

from matplotlib.lines import Line2D

from zwerm.view.layer import Layer


class Crosshair(Layer):
    """A magenta line through the middle of the arena."""

    legend_entries = 4

    def __init__(self, sheet, view, names=False):
        xmin, ymin, xmax, ymax = view.arena.bounds
        middle = 0.5 * (ymin + ymax)
        (self._line,) = sheet.axes.plot([xmin, xmax], [middle, middle], color="#FF00FF", linewidth=3, zorder=8)

    @property
    def artists(self):
        return [self._line]

    def show(self, tracks, index, at_s):
        self._line.set_visible(True)

    def legend(self):
        return [Line2D([], [], color="#FF00FF", label="the middle")]
