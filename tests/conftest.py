"""Fixtures for every test."""

import multiprocessing.util
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from support import ROBOTS, robots_of_this_process

if TYPE_CHECKING:  # most tests need no study
    from zwerm.study.study_tables import Study

# A shell makes its background processes ignore SIGINT, and Python and its children inherit this. Tests that send SIGINT would
# then wait without end.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def _robots_importable(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let tests import robots, and drop the modules that a test has imported from its temporary folder.

    Another test may write a module of the same name, which would be refused as mixed up with the first.
    """
    monkeypatch.syspath_prepend(str(ROBOTS))
    yield
    for name, module in list(sys.modules.items()):
        if "/pytest-of-" in (getattr(module, "__file__", None) or ""):
            del sys.modules[name]


@pytest.fixture
def private_tmp(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A directory for temporary files of this test's alone, with a path short enough for a socket."""
    multiprocessing.util.get_temp_dir()  # the start server's socket stays there for later tests
    directory = Path(tempfile.mkdtemp(prefix="zt-"))
    monkeypatch.setattr(tempfile, "tempdir", str(directory))
    monkeypatch.setenv("TMPDIR", str(directory))
    yield directory
    shutil.rmtree(directory)


@pytest.fixture
def nothing_left(private_tmp: Path) -> Iterator[None]:
    """Fail the test if it leaves a robot process, a socket or a private directory behind."""
    yield
    assert robots_of_this_process() == set(), "robot processes left"
    left = [path for path in private_tmp.iterdir() if path.name.startswith("zwerm-")]
    assert left == [], "private directories left"


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., "Study"]]:
    """A function that writes a study of a tiny scenario and loads it."""
    from study_files import study_writer

    yield from study_writer(tmp_path, monkeypatch)


@pytest.fixture
def gossip(tmp_path: Path) -> Path:
    """The file of a scenario with ten robots that gossip for two seconds."""
    from comparisons import GOSSIP

    path = tmp_path / "talk.toml"
    path.write_text(GOSSIP)
    return path
