"""Pictures of a run: one that explains itself, at its end or at any moment, and an animation.

Both show the arena in metres, where the robots went and where they are, what they cover and which cells they occupy; where
a deployment told of its stages, the simplicial complex, and how the arena was filled, in a plot below. A picture only looks
at what it is given. Importing this module needs matplotlib, which comes with the `study` extra.
"""

import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from zwerm.errors import PictureError
from zwerm.record.history import History, Tracks
from zwerm.view.snapshots import Snapshot, stages, true_stage
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics.sight import SeenArea, hexagonal_packing_robots
from zwerm.world.tick.telemetry import TelemetryRecord

try:
    from matplotlib.colors import to_rgb

    from zwerm.view.canvas import BLUE, ORANGE, VERMILLION, WALL, YELLOW, Sheet, Swarm, gone_at_the_end, readable
    from zwerm.view.complex_layer import EDGE, FRONTIER, OBSTACLE, PUSH, TRIANGLE, ComplexLayer
    from zwerm.view.coverage_curve import CoverageCurve, draw_growth, growth
except ImportError as missing:
    raise PictureError(f"pictures need matplotlib ({missing}): pip install 'zwerm[study]'") from None

Progress = Callable[[int, int], None]

ANIMATION_DPI: Final = 100
ANIMATION_INCHES: Final = (6.0, 5.0)
# How long an animation lasts unless it is told how fast to run, and one of a deployment; and how much of the way it shows
# behind a robot.
ANIMATION_S: Final = 10.0
DEPLOYMENT_S: Final = 20.0
TAIL_FRACTION: Final = 0.1
GIF_COLOURS: Final = 64
GIF_APART: Final = 8
COLOURS: Final = (
    *("white", BLUE, ORANGE, VERMILLION, WALL, YELLOW),
    *(EDGE, FRONTIER, OBSTACLE, PUSH, TRIANGLE["facecolor"]),
)
LEGEND_ENTRIES_OF_STAGES: Final = 5


@dataclass(frozen=True)
class RunView:
    """What is to be seen of a run: of which scenario and seed (`name`), and how it ended (`ending`).

    `cells` is (columns, rows); `told` and `series` are as the run's result has them.
    """

    arena: Arena
    history: History
    radius_m: float
    name: str
    ending: str = ""
    coverage_radius_m: float | None = None
    cells: tuple[int, int] | None = None
    sight_range_m: float | None = None
    bases: int = 0
    told: Sequence[TelemetryRecord] = ()
    series: Mapping[str, Sequence[float]] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """One line that names the run."""
        return f"{self.name}: {self.ending}" if self.ending else self.name

    @cached_property
    def stages(self) -> list[Snapshot]:
        """The stages of the deployment, if it is one that told of them."""
        return stages(self.told)

    @property
    def deployed(self) -> bool:
        """Whether there is a complex to show: the one that was told of, or the true one of a swarm from base stations."""
        return bool(self.stages) or (self.bases > 0 and self.sight_range_m is not None)

    @cached_property
    def growth(self) -> CoverageCurve | None:
        """How the arena was filled, if that was looked at."""
        ideal = None if self.sight_range_m is None else hexagonal_packing_robots(self.arena, self.sight_range_m)
        return growth(self.series, self.stages, ideal)

    def stage(self, cycle: int) -> Snapshot:
        """Return the stage of a cycle.

        Raises PictureError where the run told of none.
        """
        for each in self.stages:
            if each.cycle == cycle:
                return each
        told = f"{self.stages[0].cycle} to {self.stages[-1].cycle}" if self.stages else "none"
        raise PictureError(f"cycle {cycle}: expected one that the run told of, which are {told}")


def draw_run(
    path: Path,
    view: RunView,
    metrics: Mapping[str, float] | None = None,
    cycle: int | None = None,
    at_s: float | None = None,
) -> Path:
    """Draw a run at its end, at a deployment cycle or at a time [s] at `path` (.png, .pdf or .svg), and return the path.

    `metrics` are to be written above. Raises PictureError where the file cannot be written, or the moment is not of the run.
    """
    _make_room(path, (".png", ".pdf", ".svg"))
    tracks = _until(view.history.arrays(), None if cycle is None else view.stage(cycle), at_s)
    stage = _stage_at(view, tracks, -1, None if cycle is None and at_s is None else float(tracks.time_s[-1]))
    at_end = cycle is None and at_s is None
    title = view.title if at_end else f"{view.name}: at {float(tracks.time_s[-1]):g} s"
    text = _in_words(metrics or {}) if at_end else _moment_in_words(view, tracks, -1, stage)
    swarm_entries = 3 + len(gone_at_the_end(tracks)) + (view.coverage_radius_m is not None) + (view.cells is not None)
    entries = (LEGEND_ENTRIES_OF_STAGES + 4) if view.deployed else swarm_entries
    sheet = Sheet(view.arena, title, text, entries, with_plot=view.growth is not None)
    swarm, simplices = _compose(sheet, view, tracks, names=True)
    swarm.show_ends()
    swarm.show(len(tracks.time_s) - 1, since=0)
    if simplices is not None:
        simplices.show(stage)
    if view.growth is not None and sheet.plot is not None:
        mark = draw_growth(sheet.plot, view.growth)
        mark.set_xdata([view.growth.at(float(tracks.time_s[-1]))[0]])
        mark.set_visible(not at_end)
    sheet.draw_legend([*swarm.legend(), *(simplices.legend(bool(view.stages)) if simplices else [])])
    try:
        sheet.figure.savefig(path)
    except OSError as error:
        raise PictureError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def animate_run(
    path: Path, view: RunView, fps: int = 20, speed_up: float | None = None, progress: Progress | None = None
) -> Path:
    """Draw a run as an animation at `path`, a .gif, or an .mp4 where ffmpeg is installed, and return the path.

    A second of the animation shows `speed_up` seconds of the run; by default the whole lasts some 10 s, that of a deployment
    20. `progress` is told how many frames of how many are done. Raises PictureError where the file cannot be written.
    """
    _make_room(path, (".gif", ".mp4"))
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise PictureError(f"{path}: an .mp4 needs ffmpeg, which is not installed; choose a .gif")
    tracks = view.history.arrays()
    start_s, end_s = float(tracks.time_s[0]), float(tracks.time_s[-1])
    speed_up = speed_up or max(1.0, (end_s - start_s) / (DEPLOYMENT_S if view.deployed else ANIMATION_S))
    moments = np.append(np.arange(start_s, end_s, speed_up / fps), end_s)
    entries = (LEGEND_ENTRIES_OF_STAGES + 4) if view.deployed else 4
    sheet = Sheet(
        view.arena, view.title, "", entries, view.growth is not None, arena_inches=ANIMATION_INCHES, dpi=ANIMATION_DPI
    )
    swarm, simplices = _compose(sheet, view, tracks)
    sheet.draw_legend([*swarm.legend(moving=True), *(simplices.legend(bool(view.stages)) if simplices else [])])
    moving = [*swarm.artists, *(simplices.artists if simplices else [])]
    mark = draw_growth(sheet.plot, view.growth) if view.growth is not None and sheet.plot is not None else None
    if mark is not None:
        mark.set_visible(True)
        moving.append(mark)
    sheet.freeze(moving)
    tail_s = TAIL_FRACTION * (end_s - start_s)

    def frames() -> Iterator[NDArray[np.uint8]]:
        for done, moment_s in enumerate(moments, start=1):
            index = int(np.searchsorted(tracks.time_s, moment_s + 1e-9, side="right")) - 1
            swarm.show(index, since=int(np.searchsorted(tracks.time_s, moment_s - tail_s)))
            stage = _stage_at(view, tracks, index, moment_s)
            if simplices is not None:
                simplices.show(stage)
            if mark is not None and view.growth is not None:
                mark.set_xdata([view.growth.at(moment_s)[0]])
            words = _moment_in_words(view, tracks, index, stage)
            clock = f"{moment_s:.1f} s, shown {speed_up:.3g} times as fast"
            sheet.note.set_text(f"{clock}   {words}" if view.growth is not None else clock)
            yield sheet.frame()
            if progress is not None:
                progress(done, len(moments))

    try:
        (_write_mp4 if path.suffix.lower() == ".mp4" else _write_gif)(path, frames(), fps)
    except OSError as error:
        raise PictureError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def _compose(sheet: Sheet, view: RunView, tracks: Tracks, names: bool = False) -> tuple[Swarm, ComplexLayer | None]:
    """Put the swarm on the sheet, over its simplicial complex if there is one to show."""
    simplices = ComplexLayer(sheet, names, view.radius_m) if view.deployed else None
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
        view.deployed,
    )
    return swarm, simplices


def _stage_at(view: RunView, tracks: Tracks, index: int, at_s: float | None) -> Snapshot | None:
    """Return the last stage by a time, or of all; where none was told of, the true complex at a sample of the tracks."""
    if not view.stages:
        if not view.deployed or view.sight_range_m is None:
            return None
        standing = tracks.present[index] & ~tracks.dead[index]
        time_s = float(tracks.time_s[index])
        return true_stage(time_s, tracks.position[index], standing, view.arena, view.sight_range_m)
    until = [each for each in view.stages if at_s is None or each.time_s <= at_s + 1e-9]
    return until[-1] if until else None


def _until(tracks: Tracks, stage: Snapshot | None, at_s: float | None) -> Tracks:
    """Return the tracks up to a stage, or to a time [s].

    Raises PictureError where the run has no such time.
    """
    if stage is not None:
        shown = tracks.until(stage.time_s)
        shown.time_s[-1], shown.position[-1], shown.present[-1] = stage.time_s, stage.position, stage.present
        return shown
    if at_s is None:
        return tracks
    if not tracks.time_s[0] <= at_s <= tracks.time_s[-1] + 1e-9:
        raise PictureError(f"{at_s:g} s: expected a time of the run, which lasted {tracks.time_s[-1]:g} s")
    return tracks.until(at_s)


def _write_gif(path: Path, frames: Iterator[NDArray[np.uint8]], fps: int) -> None:
    """All frames share one palette, so that colours do not flicker and the file stays small.

    It is the first frame's, and the colours that later ones may show.
    """
    frame = Image.fromarray(next(frames)).convert("RGB")
    palette = frame.quantize(GIF_COLOURS - len(COLOURS), dither=Image.Dither.NONE)
    named = np.round(255.0 * np.array([to_rgb(colour) for colour in COLOURS])).astype(np.int64)
    found = np.array(palette.getpalette(), dtype=np.int64).reshape(-1, 3)[: GIF_COLOURS - len(COLOURS)]
    apart = np.abs(found[:, None] - named).max(axis=2).min(axis=1)
    palette.putpalette([*named.ravel().tolist(), *found[apart > GIF_APART].ravel().tolist()])
    first = frame.quantize(palette=palette, dither=Image.Dither.NONE)
    rest = [Image.fromarray(each).convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE) for each in frames]
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


def _moment_in_words(view: RunView, tracks: Tracks, index: int, stage: Snapshot | None) -> str:
    """Return what may be said of a moment: its cycle, how many robots there are, and how much they have in sight."""
    robots = int((tracks.present & ~tracks.dead)[index].sum())
    words = [f"cycle {stage.cycle}"] if stage is not None and stage.cycle is not None else []
    words.append(f"{robots} robot{'' if robots == 1 else 's'}")
    if view.growth is not None:
        words.append(f"{100.0 * view.growth.at(float(tracks.time_s[index]))[1]:.1f} % in sight")
    return "   ".join(each.replace(" ", NO_BREAK) for each in words)


def _in_words(metrics: Mapping[str, float]) -> str:
    """Return the metrics on one line: fractions in percent, other numbers with the unit that their names end in.

    Of a deployment, only what tells how it went.
    """
    words = []
    chosen = DEPLOYMENT if DEPLOYMENT[0] in metrics else tuple(metrics)
    for name, value in ((name, metrics[name]) for name in chosen if name in metrics):
        if name.endswith("_fraction"):
            shown = f"{100.0 * value:.1f} %"
        else:
            unit = next((unit for suffix, unit in UNITS.items() if name.endswith(suffix)), "")
            shown = f"{value:.4g}{unit}"
        words.append(f"{readable(name)} {shown}".replace(" ", NO_BREAK))
    return "   ".join(words)


NO_BREAK: Final = "\N{NO-BREAK SPACE}"
DEPLOYMENT: Final = (
    *("coverage_fraction", "robots_deployed", "hexagonal_packing_robots", "robots_over_hexagonal"),
    *("holes", "obstacles", "deployment_cycles", "redundant_robots"),
)
UNITS: Final = {"_m_s": " m/s", "_m2": " m²", "_m": " m", "_s": " s"}
