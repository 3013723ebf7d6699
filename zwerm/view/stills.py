"""Still pictures of a run, at its end or at any moment.

A picture shows the arena in metres, and the paths and positions of the robots. It also shows the covered area, the
occupied cells, and the layers of the algorithm. If coverage was measured, a plot below shows how the arena was filled.
Importing this module needs matplotlib.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from zwerm.errors import PictureError
from zwerm.record.history import Tracks

try:
    from zwerm.view.canvas import Sheet
    from zwerm.view.composition import Composition
    from zwerm.view.coverage_curve import draw_curve
    from zwerm.view.layer import Stage
    from zwerm.view.output import prepare
    from zwerm.view.picture_style import PictureStyle
    from zwerm.view.run_view import RunView
except ImportError as missing:
    raise PictureError(f"pictures need matplotlib ({missing}): pip install matplotlib") from None


ARENA_INCHES: Final = (8.0, 7.0)
DEFAULT: Final = PictureStyle()


def draw_run(
    path: Path,
    view: RunView,
    metrics: Mapping[str, float] | None = None,
    cycle: int | None = None,
    at_s: float | None = None,
    style: PictureStyle = DEFAULT,
) -> Path:
    """Draw a run at its end, at a numbered stage or at a time [s] at `path` (.png, .pdf or .svg), and return the path.

    `metrics` are written above. Raises PictureError where the file cannot be written, or the moment is not of the run.
    """
    prepare(path, (".png", ".pdf", ".svg"))
    run = Composition(view)
    tracks = _until(view.history.arrays(), None if cycle is None else run.stage(cycle), at_s)
    at_end = cycle is None and at_s is None
    now_s = None if at_end else float(tracks.time_s[-1])
    title = view.title if at_end else f"{view.name}: at {float(tracks.time_s[-1]):g} s"
    text = run.metrics_in_words(metrics or {}) if at_end else run.moment_in_words(tracks, -1, now_s)
    entries, curve = run.legend_entries(tracks), run.curve
    if style.bare:
        title, text, entries, curve = "", "", 0, None
    sheet = Sheet(
        view.arena, title, text, entries, with_plot=curve is not None, arena_inches=style.size_in or ARENA_INCHES
    )
    swarm, layers = run.draw(sheet, tracks, names=True)
    swarm.show_ends()
    swarm.show(len(tracks.time_s) - 1, since=0)
    for layer in layers:
        layer.show(tracks, -1, now_s)
    if curve is not None and sheet.plot is not None:
        mark = draw_curve(sheet.plot, curve)
        mark.set_xdata([curve.at(float(tracks.time_s[-1]))[0]])
        mark.set_visible(not at_end)
    if not style.bare:
        sheet.draw_legend([*swarm.legend(), *(entry for layer in layers for entry in layer.legend())])
    try:
        sheet.figure.savefig(path)
    except OSError as error:
        raise PictureError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def _until(tracks: Tracks, stage: Stage | None, at_s: float | None) -> Tracks:
    """Return the tracks up to a stage, or to a time [s]. Raises PictureError where the run has no such time."""
    if stage is not None:
        shown = tracks.until(stage.time_s)
        shown.time_s[-1], shown.position[-1], shown.present[-1] = stage.time_s, stage.position, stage.present
        return shown
    if at_s is None:
        return tracks
    if not tracks.time_s[0] <= at_s <= tracks.time_s[-1] + 1e-9:
        raise PictureError(f"{at_s:g} s: expected a time of the run, which lasted {tracks.time_s[-1]:g} s")
    return tracks.until(at_s)
