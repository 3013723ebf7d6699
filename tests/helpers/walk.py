"""Follow a page of the documentation as a reader does: save its files, and run its commands in order.

- A block with a title that is a file name (`title="meadow.toml"`) is saved under that name.
- In a `console` block, every line that begins with `$ ` is a command. It must exit with status 0, or with the status that the
  title of the block names (`title="Exit status 1"`).
- A `text` block lists lines that the commands of the `console` block before it have printed.
"""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from support import ROOT

FENCE = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TITLE = re.compile(r'title="([^"]*)"')
FILE = re.compile(r"[\w.-]+\.\w+")
STATUS = re.compile(r"Exit status (\d+)")
COMMAND_S_MAX = 300


class Block(NamedTuple):
    """A fenced block: its language, its title, its text, and the number of its first line in the page."""

    language: str
    title: str
    text: str
    line: int


def blocks(page: str) -> Iterator[Block]:
    """Yield the blocks of a page, or of a part of it."""
    for found in FENCE.finditer(page):
        title = TITLE.search(found[2])
        yield Block(found[1], title[1] if title else "", found[3], page.count("\n", 0, found.start()) + 1)


def part(page: str, heading: str) -> str:
    """Return the part of a page below a second-level heading."""
    return page.split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]


def words(text: str) -> str:
    """Return a text with one space between its words."""
    return " ".join(text.split())


class Reader:
    """A reader with a folder and a shell: `zwerm` is that of the tree `root`, and `python` that of these tests."""

    def __init__(self, folder: Path, root: Path = ROOT) -> None:
        self.folder = folder
        self.printed = ""
        self.commands = 0
        tools = folder / ".tools"
        tools.mkdir()
        python = shlex.quote(sys.executable)
        for name, arguments in (("python", ""), ("zwerm", " -P -m zwerm")):
            tool = tools / name
            tool.write_text(f'#!/bin/sh\nexec {python}{arguments} "$@"\n', encoding="utf-8")
            tool.chmod(0o755)
        self._where = tools / "where"
        self._environment = os.environ | {
            "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(root),
            "COLUMNS": "200",
        }

    def follow(self, page: str) -> None:
        """Do what the blocks of a page say. Raises AssertionError with the line of the page where it is not true."""
        for block in blocks(page):
            if FILE.fullmatch(block.title):
                (self.folder / block.title).write_text(block.text, encoding="utf-8")
            elif block.language == "console":
                self.run(block)
            elif block.language == "text":
                for line in filter(str.strip, block.text.splitlines()):
                    assert words(line) in words(self.printed), f"line {block.line}: not printed: {line}\n{self.printed}"

    def run(self, block: Block) -> None:
        """Run the commands of a block, each in the folder that the one before has left."""
        status = STATUS.fullmatch(block.title)
        self.printed = ""
        for line in block.text.splitlines():
            if not line.startswith("$ "):
                continue
            script = f"{line[2:]}\nstatus=$?\npwd > {shlex.quote(str(self._where))}\nexit $status"
            done = subprocess.run(
                ["bash", "-c", script],
                cwd=self.folder,
                env=self._environment,
                capture_output=True,
                text=True,
                timeout=COMMAND_S_MAX,
                check=False,
            )
            self.commands += 1
            self.printed += done.stdout + done.stderr
            assert done.returncode == (int(status[1]) if status else 0), f"line {block.line}: {line}\n{self.printed}"
            self.folder = Path(self._where.read_text(encoding="utf-8").strip())
