"""Fixtures for every test."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from support import ROBOTS, robots_of_this_process


@pytest.fixture(autouse=True)
def _robots_importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROBOTS))


@pytest.fixture
def nothing_left() -> Iterator[None]:
    """Fail the test if it leaves a robot process or a private directory behind."""
    directory = Path(tempfile.gettempdir())
    before = set(directory.glob("zwerm-*"))
    yield
    assert robots_of_this_process() == set(), "robot processes left"
    assert set(directory.glob("zwerm-*")) - before == set(), "private directories left"
