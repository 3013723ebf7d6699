"""Errors and breakpoints in a user's controller, as the command line shows them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support import ROOT, ZWERM

from zwerm.cli.tracebacks import grouped

CONTROLLERS = """
import dataclasses
from zwerm import Command, Controller, WheelSpeeds

class Plain(Controller):
    def step(self, observation):
        return Command()

class Raises(Plain):
    def step(self, observation):
        if observation.tick == 3:
            raise ValueError(f"no luck for {self.setup.node}")
        return Command()

class Refused(Plain):
    def step(self, observation):
        if observation.tick == 3 and self.setup.node == 1:
            return Command(drive=WheelSpeeds(float("nan"), 0.0))
        return Command()

class Forges(Plain):
    def step(self, observation):
        raise ValueError("no luck\\nzwerm: all is well")

class Stops(Plain):
    def step(self, observation):
        if observation.tick == 3 and self.setup.node == 1:
            breakpoint()
        return Command()

class NoSetup(Plain):
    def __init__(self):
        pass

class TextSensors(Plain):
    sensors = "compass"

class NoStep(Controller):
    def setp(self, observation):
        return Command()

class NoSuper(Plain):
    def __init__(self, setup):
        self.speed = 1.0

    def step(self, observation):
        return Command(telemetry={"x": self.random.uniform()})

class Nothing(Plain):
    def step(self, observation):
        pass

class BadConstructor(Plain):
    def __init__(self, setup):
        super().__init__(setup)
        self.ratio = 1 / 0

class WithDataclass(Plain):
    @dataclasses.dataclass
    class Parameters:
        speed: float = 1.0
"""


def run(folder: Path, controller: str, *options: str, typed: str = "") -> subprocess.CompletedProcess[str]:
    (folder / "debugged.py").write_text(CONTROLLERS)
    arguments = ["run", "computation-free", "--set", "time.duration_s=0.5", "--set", "robots.count=12"]
    environment = {"PYTHONPATH": str(ROOT), "PATH": os.environ["PATH"], "COLUMNS": "120", "HOME": str(folder)}
    return subprocess.run(
        [sys.executable, *ZWERM, *arguments, "--set", f"robots.controller=debugged:{controller}", *options],
        cwd=folder,
        env=environment,
        input=typed,
        capture_output=True,
        text=True,
        timeout=120,
    )


def trace_of(output: str) -> str:
    return next(line.split()[1] for line in output.splitlines() if line.startswith("trace "))


def test_an_error_of_many_robots_is_printed_once_with_the_line_of_the_user(tmp_path: Path) -> None:
    ran = run(tmp_path, "Raises", "--inline", "--quiet")
    assert ran.returncode == 1
    printed = [line.strip() for line in ran.stderr.splitlines()]
    assert printed[0] == "node 0 raised, and 11 more from the same line: 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, ..."
    assert [line for line in printed if line.startswith("File ")] == [
        f'File "{tmp_path / "debugged.py"}", line 12, in step'
    ]
    assert printed.count("ValueError: no luck for 0") == 1
    assert printed[-1] == "zwerm: node 0 crashed at tick 3: ValueError: no luck for 0 (debugged.py:12, in step)"


def test_errors_from_different_lines_or_of_different_kinds_are_printed_separately() -> None:
    one, other = 'File "a.py", line 1, in f\n', 'File "a.py", line 2, in f\n'
    head = "Traceback (most recent call last):\n  "
    found = grouped(
        {
            4: f"{head}{one}ValueError: 4",
            1: f"{head}{one}ValueError: 1",
            2: f"{head}{other}ValueError: 1",
            3: f"{head}{one}KeyError: 1",
        }
    )
    assert found == [[1, 4], [2], [3]]


def test_a_breakpoint_opens_the_debugger_and_the_run_goes_on_with_the_same_trace(tmp_path: Path) -> None:
    ran = run(tmp_path, "Stops", "--inline", typed="p observation.tick + 1000\nc\n")
    assert ran.returncode == 0, ran.stderr
    assert "(Pdb) 1003" in ran.stdout
    assert trace_of(ran.stdout) == trace_of(run(tmp_path, "Plain", "--inline").stdout)


def test_quitting_the_debugger_ends_the_run_as_interrupted(tmp_path: Path) -> None:
    ran = run(tmp_path, "Stops", "--inline", typed="q\n")
    assert ran.returncode == 130
    assert "zwerm: interrupted at tick 3" in ran.stderr
    assert "Traceback" not in ran.stderr


def test_a_breakpoint_in_a_process_names_the_option_that_it_needs(tmp_path: Path) -> None:
    ran = run(tmp_path, "Stops")
    assert ran.returncode == 1
    assert "breakpoint() needs a terminal, and a robot process has none: run with --inline" in ran.stderr


@pytest.mark.parametrize(
    ("controller", "printed"),
    [
        (
            "NoSetup",
            "robots.controller: debugged:NoSetup: a controller's constructor takes its Setup: __init__(self, setup)",
        ),
        ("BadConstructor", "debugged:BadConstructor: its constructor raised ZeroDivisionError: division by zero ("),
        (
            "TextSensors",
            "debugged:TextSensors: its sensors must be a tuple of names, such as ('compass',), got 'compass'",
        ),
        ("NoStep", "debugged:NoStep: a controller needs a method step(observation) -> Command"),
        ("WithDataclass", "debugged:WithDataclass: its Parameters must be a subclass of msgspec.Struct, got <class"),
    ],
)
def test_a_class_that_cannot_be_a_controller_is_one_line(tmp_path: Path, controller: str, printed: str) -> None:
    ran = run(tmp_path, controller)
    assert ran.returncode == 2
    assert len(ran.stderr.splitlines()) == 1
    assert printed in ran.stderr


def test_a_refused_command_is_named_although_the_run_goes_on(tmp_path: Path) -> None:
    ran = run(tmp_path, "Refused", "--inline", "--quiet", "--set", "robots.on_crash=continue")
    assert ran.returncode == 0
    assert "node 1 crashed at tick 3: its command was refused: not-finite: WheelSpeeds(left_m_s=nan" in ran.stderr


@pytest.mark.parametrize("library", ["numpy", "pydantic"])
def test_a_file_that_hides_a_library_is_named(tmp_path: Path, library: str) -> None:
    (tmp_path / f"{library}.py").write_text("mine = 1")
    ran = run(tmp_path, "Plain", "--inline", "--quiet")
    assert ran.returncode == 2
    assert ran.stderr == f"zwerm: {tmp_path / library}.py hides the library '{library}': give it another name\n"


def test_crashes_of_many_robots_for_one_reason_are_one_line(tmp_path: Path) -> None:
    ran = run(tmp_path, "Nothing", "--inline", "--quiet", "--set", "robots.on_crash=continue")
    (line, *_) = ran.stderr.splitlines()
    assert line.startswith(
        "node 0 crashed at tick 0: TypeError: step() returned None, expected a Command (debugged.py:"
    )
    assert line.endswith("), and 11 more: 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, ...")
    assert ran.stderr.count("TypeError") <= 2, "the reason of the run, if all its robots are lost, is the second"


def test_an_answer_that_is_no_command_is_one_line_without_a_traceback(tmp_path: Path) -> None:
    ran = run(tmp_path, "Nothing", "--inline", "--quiet")
    assert ran.returncode == 1
    line = (
        next(number for number, text in enumerate(CONTROLLERS.splitlines(), 1) if text == "class Nothing(Plain):") + 1
    )
    rule = "TypeError: step() returned None, expected a Command"
    assert ran.stderr == f"zwerm: node 0 crashed at tick 0: {rule} (debugged.py:{line}, in Nothing.step)\n"


def test_a_constructor_that_forgets_its_base_class_is_told_what_to_call(tmp_path: Path) -> None:
    ran = run(tmp_path, "NoSuper", "--inline", "--quiet")
    assert ran.returncode == 1
    assert "AttributeError: no setup: the constructor of NoSuper must call super().__init__(setup)" in ran.stderr


def test_no_error_of_a_controller_adds_a_line_that_seems_to_be_of_zwerm(tmp_path: Path) -> None:
    ran = run(tmp_path, "Forges", "--inline", "--quiet")
    [line] = [line for line in ran.stderr.splitlines() if line.startswith("zwerm:")]
    assert line.startswith("zwerm: node 0 crashed at tick 0: ValueError: no luck\\nzwerm: all is well (debugged.py:")
