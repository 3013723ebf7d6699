"""Draw the pictures of the gallery: `python docs/gallery.py`, or `python docs/gallery.py NAME ...` for some scenarios only.

With `--buildings` it draws instead the runs of `benchmarks.algorithms.bench_buildings` with seed 1 and no noise, one for each
kind of building.

Runs each built-in scenario inline with seed 1 and writes its picture, reduced to a small palette, to `docs/images/gallery/`.
All of them together take about fifteen minutes of processor time. Run `make pages` afterwards: the page lists the pictures that
are there.
"""

import argparse
import io
import sys
from pathlib import Path
from typing import Final

from PIL import Image, ImageColor

import zwerm
from zwerm.scenario.load import built_in
from zwerm.view.canvas import BLUE, ORANGE, OUTSIDE, SKY, VERMILLION, WALL, YELLOW
from zwerm.view.layers.landmark_exploration import LandmarkComplexLayer, LandmarkNavigationLayer

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))

from random_buildings import KINDS, random_building

FOLDER: Final = Path(__file__).parent / "images" / "gallery"
BUILDINGS: Final = FOLDER / "buildings"
BODY_M: Final = 0.14
SEED: Final = 1
WIDTHS: Final = (900, 760, 640)  # pixels, tried in this order
HEIGHT_MAX: Final = 1200
COLOURS: Final = (96, 64, 48, 32, 16)  # besides those that are kept; tried in this order until the file is small enough
# Colours that few pixels have, and that a palette made for the whole picture would lose.
KEPT: Final = (
    *("#FFFFFF", BLUE, ORANGE, OUTSIDE, SKY, VERMILLION, WALL, YELLOW),
    *LandmarkComplexLayer.colours,
    *LandmarkNavigationLayer.colours,
)
BYTES_MAX: Final = 150_000


def small(path: Path) -> bytes:
    """Return a PNG with a palette, at most BYTES_MAX large where one of WIDTHS and COLOURS allows it."""
    with Image.open(path) as opened:
        whole = opened.convert("RGB")
    for width in WIDTHS:
        picture = whole.copy()
        picture.thumbnail((width, HEIGHT_MAX), Image.Resampling.LANCZOS)
        for colours in COLOURS:
            palette = Image.new("P", (1, 1))
            most_used = picture.quantize(colours, dither=Image.Dither.NONE).getpalette() or []
            palette.putpalette([*(value for colour in KEPT for value in ImageColor.getrgb(colour)), *most_used])
            file = io.BytesIO()
            picture.quantize(palette=palette, dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
            if file.tell() <= BYTES_MAX:
                return file.getvalue()
    return file.getvalue()


def draw(name: str) -> Path:
    """Run a scenario and write its picture."""
    path = FOLDER / f"{name}.png"
    zwerm.run(name, seed=SEED, runner="inline").picture(path)
    path.write_bytes(small(path))
    return path


def draw_building(kind: str) -> Path:
    """Run sensor coverage in a drawn building and write its picture."""
    path = BUILDINGS / f"{kind}.png"
    arena = f'arena={{wkt="{random_building(kind, SEED)}", passage_m={BODY_M}}}'
    settings = (arena, "robots.sensors.0.sd_rad=0.0")
    zwerm.run("sensor-coverage-map", seed=SEED, runner="inline", overrides=settings).picture(path)
    path.write_bytes(small(path))
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw the pictures of the gallery.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="a built-in scenario; all of them by default")
    parser.add_argument("--buildings", action="store_true", help="draw sensor coverage in drawn buildings instead")
    options = parser.parse_args()
    BUILDINGS.mkdir(parents=True, exist_ok=True)
    names = KINDS if options.buildings else options.names or built_in()
    for name in names:
        path = draw_building(name) if options.buildings else draw(name)
        print(f"{name}: {path.stat().st_size:,} bytes", flush=True)


if __name__ == "__main__":
    main()
