"""Fixtures for every test."""

import multiprocessing.util
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import hypothesis
import pytest
from support import ROBOTS, robots_of_this_process

if TYPE_CHECKING:  # most tests need no study
    from zwerm.study.study_tables import Study

# A shell makes its background processes ignore SIGINT, and Python and its children inherit this. Tests that send SIGINT would
# then wait without end.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Hypothesis fails an example that takes more than 200 ms, by the clock: on a busy machine any example may.
hypothesis.settings.register_profile("no deadline", deadline=None)
hypothesis.settings.load_profile("no deadline")

# The files that take longest, the longest first. They start first, so that no worker ends with a long one.
LONG = (
    "docs/test_readme.py",
    "agents/sensor_coverage/test_lost_memory.py",
    "docs/test_catalogue_rows.py",
    "agents/sensor_coverage/test_wall_walk.py",
    "agents/sensor_coverage/test_local_coverage.py",
    "study/test_trial_identity.py",
    "agents/sensor_coverage/protocols/test_interleavings.py",
    "study/test_study_distribution.py",
    "study/test_study_command.py",
    "docs/test_tutorial.py",
    "world/faults/test_fault_processes.py",
    "coordinator/sensor_coverage/test_redundancy_advisor.py",
    "twin/test_twin.py",
    "compare/test_comparison_output.py",
    "study/test_study_trials.py",
    "run/test_determinism.py",
    "deploy/test_run_manifests.py",
    "docs/test_search.py",
    "docs/test_recipes.py",
    "deploy/test_supervisor.py",
    "cli/test_new_project.py",
    "agents/sensor_coverage/test_sensor_coverage.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of the LONG files first; the order of all others stays."""
    place = {Path(__file__).parent / name: number for number, name in enumerate(LONG)}
    items.sort(key=lambda item: place.get(item.path, len(LONG)))


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
def private_tmp(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A directory for temporary files of this test's alone, with a path short enough for a socket."""
    tmp_path_factory.getbasetemp()  # the folders of later tests are not made in this directory
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
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """End robots that do not leave 0.3 s after the request, and kill them 0.3 s later, not after 3 s and 2 s."""
    monkeypatch.setattr("zwerm.deploy.swarm.LEAVE_WAIT_S", 0.3)
    monkeypatch.setattr("zwerm.deploy.supervisor.TERMINATE_WAIT_S", 0.3)


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
