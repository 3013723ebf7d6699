"""Pictures of a run: one that explains itself, and an animation.

Both show the arena in metres, where the robots went and where they are, what they cover and which cells they occupy. A
picture only looks at what it is given. Importing this module needs matplotlib, which comes with the `study` extra.
"""

import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from zwerm.errors import PictureError
from zwerm.world.arena import Arena
from zwerm.world.history import History

try:
    from zwerm.world.canvas import Series, Sheet, Swarm, gone_at_the_end, readable
except ImportError as missing:
    raise PictureError(f"pictures need matplotlib ({missing}): pip install 'zwerm[study]'") from None

Progress = Callable[[int, int], None]

ANIMATION_DPI: Final = 100
ANIMATION_INCHES: Final = (6.0, 5.0)
# How long an animation lasts unless it is told how fast to run, and how much of the way it shows behind a robot.
ANIMATION_S: Final = 10.0
TAIL_FRACTION: Final = 0.1
GIF_COLOURS: Final = 64


def draw_run(
    path: Path,
    arena: Arena,
    history: History,
    radius_m: float,
    title: str,
    metrics: Mapping[str, float],
    coverage_radius_m: float | None = None,
    cells: tuple[int, int] | None = None,
    series: Series | None = None,
) -> Path:
    """Draw the end of a run and the way there at `path` (.png, .pdf or .svg), and return the path.

    `cells` is (columns, rows); `series` are curves to draw below the arena. Raises PictureError where the file cannot be
    written.
    """
    _make_room(path, (".png", ".pdf", ".svg"))
    tracks = history.arrays()
    left = len(gone_at_the_end(tracks)) > 0
    entries = 3 + left + (coverage_radius_m is not None) + (cells is not None)
    sheet = Sheet(arena, title, _in_words(metrics), entries, series)
    swarm = Swarm(sheet, arena, tracks, radius_m, coverage_radius_m, cells)
    swarm.show_ends()
    swarm.show(len(tracks.time_s) - 1, since=0)
    sheet.draw_legend(swarm.legend())
    try:
        sheet.figure.savefig(path)
    except OSError as error:
        raise PictureError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def animate_run(
    path: Path,
    arena: Arena,
    history: History,
    radius_m: float,
    title: str,
    coverage_radius_m: float | None = None,
    cells: tuple[int, int] | None = None,
    fps: int = 20,
    speed_up: float | None = None,
    progress: Progress | None = None,
) -> Path:
    """Draw a run as an animation at `path`, a .gif, or an .mp4 where ffmpeg is installed, and return the path.

    A second of the animation shows `speed_up` seconds of the run; by default the whole lasts some 10 s. `progress` is
    told how many frames of how many are done. Raises PictureError where the file cannot be written.
    """
    _make_room(path, (".gif", ".mp4"))
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise PictureError(f"{path}: an .mp4 needs ffmpeg, which is not installed; choose a .gif")
    tracks = history.arrays()
    start_s, end_s = float(tracks.time_s[0]), float(tracks.time_s[-1])
    speed_up = speed_up or max(1.0, (end_s - start_s) / ANIMATION_S)
    moments = np.append(np.arange(start_s, end_s, speed_up / fps), end_s)
    sheet = Sheet(arena, title, arena_inches=ANIMATION_INCHES, dpi=ANIMATION_DPI)
    swarm = Swarm(sheet, arena, tracks, radius_m, coverage_radius_m, cells)
    sheet.freeze(swarm.artists)
    tail_s = TAIL_FRACTION * (end_s - start_s)

    def frames() -> Iterator[NDArray[np.uint8]]:
        for done, moment_s in enumerate(moments, start=1):
            index = int(np.searchsorted(tracks.time_s, moment_s + 1e-9, side="right")) - 1
            swarm.show(index, since=int(np.searchsorted(tracks.time_s, moment_s - tail_s)))
            sheet.note.set_text(f"{moment_s:.1f} s, shown {speed_up:.3g} times as fast")
            yield sheet.frame()
            if progress is not None:
                progress(done, len(moments))

    try:
        (_write_mp4 if path.suffix.lower() == ".mp4" else _write_gif)(path, frames(), fps)
    except OSError as error:
        raise PictureError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def _write_gif(path: Path, frames: Iterator[NDArray[np.uint8]], fps: int) -> None:
    """All frames share the first one's palette: colours do not flicker, and the file stays small."""
    first = Image.fromarray(next(frames)).convert("RGB").quantize(GIF_COLOURS, dither=Image.Dither.NONE)
    rest = [Image.fromarray(each).convert("RGB").quantize(palette=first, dither=Image.Dither.NONE) for each in frames]
    first.save(path, save_all=True, append_images=rest, duration=round(1000 / fps), loop=0)


def _write_mp4(path: Path, frames: Iterator[NDArray[np.uint8]], fps: int) -> None:
    first = next(frames)
    height, width = first.shape[:2]
    raw = ["-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}", "-r", str(fps), "-i", "-"]
    # Players want even sizes and this pixel format.
    out = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-pix_fmt", "yuv420p", str(path)]
    command = ["ffmpeg", "-loglevel", "error", "-y", *raw, *out]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        with suppress(BrokenPipeError):
            for frame in chain([first], frames):
                ffmpeg.stdin.write(frame.tobytes())
        _, said = ffmpeg.communicate()
    if ffmpeg.returncode:
        raise PictureError(f"{path}: ffmpeg failed: {said.decode(errors='replace').strip().splitlines()[-1]}")


def _make_room(path: Path, suffixes: tuple[str, ...]) -> None:
    if path.suffix.lower() not in suffixes:
        raise PictureError(f"{path}: expected a file that ends in {' or '.join(suffixes)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PictureError(f"{path}: its folder cannot be made: {error.strerror}") from None


def _in_words(metrics: Mapping[str, float]) -> str:
    """Return the metrics on one line: fractions in percent, other numbers with the unit that their names end in."""
    words = []
    for name, value in metrics.items():
        if name.endswith("_fraction"):
            shown = f"{100.0 * value:.1f} %"
        else:
            unit = next((unit for suffix, unit in UNITS.items() if name.endswith(suffix)), "")
            shown = f"{value:.4g}{unit}"
        words.append(f"{readable(name)} {shown}".replace(" ", "\N{NO-BREAK SPACE}"))
    return "   ".join(words)


UNITS: Final = {"_m_s": " m/s", "_m2": " m²", "_m": " m", "_s": " s"}
