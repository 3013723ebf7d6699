"""Animations of a run, as GIF or, with ffmpeg, as MP4. Importing this module needs matplotlib."""

import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from zwerm.errors import PictureError

try:
    from matplotlib.colors import to_rgb

    from zwerm.view.canvas import BLUE, ORANGE, VERMILLION, WALL, YELLOW, Sheet
    from zwerm.view.composition import Composition
    from zwerm.view.coverage_curve import draw_curve
    from zwerm.view.output import prepare
    from zwerm.view.picture_style import PictureStyle
    from zwerm.view.run_view import RunView
except ImportError as missing:
    raise PictureError(f"pictures need matplotlib ({missing}): pip install matplotlib") from None

Progress = Callable[[int, int], None]

DPI: Final = 100
INCHES: Final = (6.0, 5.0)
DEFAULT: Final = PictureStyle()
# Default duration of an animation [s], and the part of the run over which a path is shown behind a robot.
DURATION_S: Final = 10.0
TAIL_FRACTION: Final = 0.1
GIF_COLOURS: Final = 64
# Least difference of a channel, of 255, between a colour of the first frame and a colour that the palette keeps.
GIF_APART: Final = 8
COLOURS: Final = ("white", BLUE, ORANGE, VERMILLION, WALL, YELLOW)


def animate_run(
    path: Path,
    view: RunView,
    fps: int = 20,
    speed_up: float | None = None,
    progress: Progress | None = None,
    style: PictureStyle = DEFAULT,
) -> Path:
    """Draw a run as an animation at `path`, a .gif, or an .mp4 where ffmpeg is installed, and return the path.

    A second of the animation shows `speed_up` seconds of the run. By default the animation lasts about 10 s, or as long
    as a layer asks for. `progress` is called with the frames done and their total. Raises PictureError where the file
    cannot be
    written.
    """
    prepare(path, (".gif", ".mp4"))
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise PictureError(f"{path}: an .mp4 needs ffmpeg, which is not installed; choose a .gif")
    run = Composition(view)
    tracks = view.history.arrays()
    start_s, end_s = float(tracks.time_s[0]), float(tracks.time_s[-1])
    duration_s = max((kind.animation_s or DURATION_S for kind in run.layers), default=DURATION_S)
    speed_up = speed_up or max(1.0, (end_s - start_s) / duration_s)
    moments = np.append(np.arange(start_s, end_s, speed_up / fps), end_s)
    with_plot = run.curve is not None and not style.bare
    title, entries = ("", 0) if style.bare else (view.title, run.legend_entries())
    sheet = Sheet(view.arena, title, "", entries, with_plot, arena_inches=style.size_in or INCHES, dpi=DPI)
    swarm, layers = run.draw(sheet, tracks)
    if not style.bare:
        sheet.draw_legend([*swarm.legend(moving=True), *(entry for layer in layers for entry in layer.legend())])
    moving = [*swarm.artists, *(artist for layer in layers for artist in layer.artists)]
    mark = draw_curve(sheet.plot, run.curve) if run.curve is not None and sheet.plot is not None else None
    if mark is not None:
        mark.set_visible(True)
        moving.append(mark)
    sheet.freeze(moving)
    tail_s = TAIL_FRACTION * (end_s - start_s)

    def frames() -> Iterator[NDArray[np.uint8]]:
        for done, moment_s in enumerate(moments, start=1):
            index = int(np.searchsorted(tracks.time_s, moment_s + 1e-9, side="right")) - 1
            swarm.show(index, since=int(np.searchsorted(tracks.time_s, moment_s - tail_s)))
            for layer in layers:
                layer.show(tracks, index, moment_s)
            if mark is not None and run.curve is not None:
                mark.set_xdata([run.curve.at(moment_s)[0]])
            words = run.moment_in_words(tracks, index, moment_s)
            clock = f"{moment_s:.1f} s, shown {speed_up:.3g} times as fast"
            sheet.note.set_text("" if style.bare else f"{clock}   {words}" if with_plot else clock)
            yield sheet.frame()
            if progress is not None:
                progress(done, len(moments))

    kept = [*COLOURS, *(colour for kind in run.layers for colour in kind.colours)]
    try:
        if path.suffix.lower() == ".mp4":
            _write_mp4(path, frames(), fps)
        else:
            _write_gif(path, frames(), fps, kept)
    except OSError as error:
        raise PictureError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def _write_gif(path: Path, frames: Iterator[NDArray[np.uint8]], fps: int, kept: Sequence[str]) -> None:
    """Write frames that share one palette: the colours of the first frame, and `kept` ones that later frames may show.

    One palette keeps colours from flickering and the file small.
    """
    frame = Image.fromarray(next(frames)).convert("RGB")
    palette = frame.quantize(GIF_COLOURS - len(kept), dither=Image.Dither.NONE)
    named = np.round(255.0 * np.array([to_rgb(colour) for colour in kept])).astype(np.int64)
    found = np.array(palette.getpalette(), dtype=np.int64).reshape(-1, 3)[: GIF_COLOURS - len(kept)]
    apart = np.abs(found[:, None] - named).max(axis=2).min(axis=1)
    palette.putpalette([*named.ravel().tolist(), *found[apart > GIF_APART].ravel().tolist()])
    first = frame.quantize(palette=palette, dither=Image.Dither.NONE)
    rest = [Image.fromarray(each).convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE) for each in frames]
    first.save(path, save_all=True, append_images=rest, duration=round(1000 / fps), loop=0)


def _write_mp4(path: Path, frames: Iterator[NDArray[np.uint8]], fps: int) -> None:
    first = next(frames)
    height, width = first.shape[:2]
    raw = ["-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}", "-r", str(fps), "-i", "-"]
    # Players need even sizes and this pixel format.
    out = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-pix_fmt", "yuv420p", str(path)]
    command = ["ffmpeg", "-loglevel", "error", "-y", *raw, *out]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        with suppress(BrokenPipeError):
            for frame in chain([first], frames):
                ffmpeg.stdin.write(frame.tobytes())
        _, output = ffmpeg.communicate()
    if ffmpeg.returncode:
        raise PictureError(f"{path}: ffmpeg failed: {output.decode(errors='replace').strip().splitlines()[-1]}")
