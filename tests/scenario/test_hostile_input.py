"""Input of unknown origin: every file and setting is used, or refused in one line; none hangs or ends in a traceback."""

import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support import ROOT, ZWERM, scenario

from zwerm.errors import ScenarioError
from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.run.validation import scenario_mistakes
from zwerm.study.study_tables import parse_seeds
from zwerm.wire.messages import Command, Failure, encode
from zwerm.wire.text import printable, printable_line

LONG = "9" * 5_000
DEEP = "[" * 5_000 + "]" * 5_000
NESTED = "[" * 200 + "]" * 200


@pytest.mark.parametrize("value", [LONG, DEEP, NESTED, "{" * 3_000, f'"{"x" * 300}"', r'"a\u0000b"', '"\U0001f600"'])
@pytest.mark.parametrize("path", ["arena.map", "robots.count", "robots.parameters.x", "field.kind"])
def test_any_value_of_a_setting_is_used_or_refused(path: str, value: str) -> None:
    found = scenario_mistakes("computation-free", (f"{path}={value}",))
    assert all(len(line) < 6_000 and "\n" not in line for line in found)
    assert found or path == "robots.parameters.x"


@pytest.mark.parametrize("dt_s", ["1e-308", "1e-300", "1e-11"])
def test_a_tick_too_short_for_the_run_is_refused(dt_s: str) -> None:
    [line] = scenario_mistakes("computation-free", (f"time.dt_s={dt_s}",))
    assert "expected duration_s of at most 1e+12 times dt_s" in line


@pytest.mark.parametrize("factor", [1e-300, -1.0, math.nan])
def test_a_pace_that_never_comes_to_a_tick_is_refused(factor: float) -> None:
    with pytest.raises(ScenarioError, match=r"^realtime: expected a factor of at least 1e-06, got "):
        run("computation-free", runner="inline", realtime=factor)


@pytest.mark.parametrize("text", [f"x = {LONG}", f"x = {DEEP}", f"x = {NESTED}", "\x00", "x" * 10_000])
def test_any_text_of_a_scenario_file_is_used_or_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "hostile.toml"
    path.write_text(text)
    [line] = scenario_mistakes(str(path))
    assert line.startswith(f"{path}: ")
    assert scenario_mistakes("n" * 300 + ".toml")[0].endswith("expected a scenario file or the name of a built-in one")


def bomb(path: Path) -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 12)]
    path.write_text("\n".join([*lines, "image: *a11", "resolution: 0.1", "origin: [0, 0, 0]"]))


def deep(path: Path) -> None:
    path.write_text("image: " + DEEP)


def far(path: Path) -> None:
    Image.fromarray(np.full((4, 4), 255, np.uint8)).save(path.parent / "white.png")
    path.write_text(
        "image: white.png\nresolution: 0.5\norigin: [1.0e+300, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )


def long_number(path: Path) -> None:
    path.write_text(f"image: {LONG}\nresolution: {LONG}\n")


@pytest.mark.parametrize("write", [bomb, deep, far, long_number])
def test_a_hostile_map_is_refused_in_one_line(write: Callable[[Path], None], tmp_path: Path) -> None:
    path = tmp_path / "map.yaml"
    write(path)
    found = scenario_mistakes("computation-free", (f"arena.map='{path}'",))
    assert found
    assert any(str(path) in line for line in found)
    assert all(len(line) < 1_000 for line in found)


def huge(path: Path) -> None:
    Image.new("1", (8_000, 8_000), 1).save(path)


def dotted(path: Path) -> None:
    pixels = np.full((1_001, 1_001), 255, np.uint8)
    pixels[1::2, 1::2] = 0
    Image.fromarray(pixels).save(path)


@pytest.mark.parametrize(
    ("write", "rule"), [(huge, "at most 16000000 pixels"), (dotted, "at most 20000 separate obstacles")]
)
def test_a_map_that_would_take_minutes_is_refused(write: Callable[[Path], None], rule: str, tmp_path: Path) -> None:
    path = tmp_path / "map.png"
    write(path)
    with pytest.raises(ScenarioError, match=rule):
        assemble(scenario(arena={"size_m": None, "map": str(path), "resolution_m": 0.1}), 1)


@pytest.mark.parametrize("seeds", ["1-99999999999", "99999999999", LONG, f"1-{LONG}"])
def test_seeds_without_end_are_refused(seeds: str) -> None:
    with pytest.raises(ScenarioError, match=r"^seeds: expected .{1,150}$"):
        parse_seeds(seeds)


def test_a_deleted_working_directory_is_an_error_of_one_line(tmp_path: Path) -> None:
    script = "import os, sys; os.chdir(sys.argv[1]); os.rmdir(sys.argv[1]); sys.argv[1:] = ['list']; " + ZWERM[1]
    (tmp_path / "gone").mkdir()
    ran = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "gone")],
        env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (ran.returncode, ran.stderr.strip()) == (
        2,
        "zwerm: the working directory was deleted; change to another one",
    )


@pytest.mark.parametrize(
    ("number", "line"),
    [("ENOSPC", "zwerm: file: No space left on device"), ("EROFS", "zwerm: file: Read-only file system")],
)
def test_a_fault_of_the_machine_is_an_error_of_one_line(number: str, line: str) -> None:
    script = (
        "import errno, os, sys; import zwerm.cli.app as app; error = errno." + number + "\n"
        "def fail(): raise OSError(error, os.strerror(error), 'file')\n"
        "app.app = fail; sys.argv[1:] = ['list']; app.main()"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script], env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True
    )
    assert (ran.returncode, ran.stderr.strip()) == (2, line)


def test_a_working_directory_that_is_deleted_in_the_start_of_a_run_is_an_error_of_one_line(tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    (tmp_path / "late.py").write_text(
        "import os\nif os.path.exists(os.environ['GONE']):\n    os.rmdir(os.environ['GONE'])\n"
        "from zwerm.agents.computation_free.reactive import *\n"
    )
    command = ("run", "computation-free", "--json", "--set", "robots.controller=late:ComputationFree")
    ran = subprocess.run(
        [sys.executable, *ZWERM, *command], cwd=tmp_path / "gone",
        env=os.environ | {"PYTHONPATH": f"{ROOT}:{tmp_path}", "GONE": str(tmp_path / "gone")},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert ran.returncode == 2
    assert "Traceback" not in ran.stderr


def test_no_text_of_a_robot_reaches_the_terminal_with_control_characters() -> None:
    assert printable("a \u202eb\u2066c\u2028d") == "a \\u202eb\\u2066c\\u2028d"
    assert printable("\x1b[2J\x07\x9b1m\udcff\tok\n") == "\\x1b[2J\\x07\\x9b1m\\udcff\tok\n"
    assert printable_line("failed\nzwerm: all is well\n") == "failed\\nzwerm: all is well\\n"
    result = run(scenario(robots={"controller": "ends:Escapes"}), runner="inline")
    assert "\n" not in result.reason
    assert "\x1b" not in result.reason + "".join(result.tracebacks.values())
    assert r"\x1b[2J" in result.reason
    world = assemble(scenario(robots={"on_crash": "continue"}), 1)
    world.observe()
    world.accept(0, encode(Failure(0, "\x1b]0;forged\x07", "\x1b[31m")))
    world.accept(1, encode(Command()).replace(b"type", b"\x1b[2J"))
    assert "\x1b" not in str(world.status.crashed) + str(world.status.failures)
