"""The search of the built site, in a real browser without a window: a word is searched, and a result is opened."""

import os
import re
import shutil
import subprocess
import sys
from html import unescape
from pathlib import Path

import pytest
from support import ROOT

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

pytestmark = pytest.mark.skipif(BROWSER is None, reason="there is no Chromium; `make tools` installs it on Debian")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the site, built from the pages."""
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", str(folder)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    subprocess.run(build, cwd=ROOT, env=environment, check=True, capture_output=True)
    return folder


def shown(address: str, profile: Path) -> str:
    """Return the document that the browser shows at an address once its scripts have run."""
    assert BROWSER is not None
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}"]
    # Virtual time: the browser ends when nothing is left to do, at the latest after so many virtual milliseconds.
    command += ["--virtual-time-budget=30000", "--dump-dom", address]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout


def results(document: str) -> list[str]:
    """Return the addresses of the search results, the best first."""
    links = re.findall(r"<a [^>]*md-search-result__link[^>]*>", document)
    return [unescape(re.findall(r'href="([^"]*)"', link)[0]) for link in links]


def test_a_word_is_found_and_its_first_result_opens_on_the_page_that_describes_it(site: Path, tmp_path: Path) -> None:
    start = (site / "index.html").as_uri()
    found = results(shown(f"{start}?q=stuck_touch", tmp_path))
    assert found
    assert all(address.startswith(site.as_uri()) for address in found), "no result leaves the site"
    assert any("reference/faults.html" in address for address in found)
    page = shown(found[0], tmp_path)
    assert "stuck_touch" in page
    assert "<h1" in page


def test_a_word_that_no_page_has_gives_no_result(site: Path, tmp_path: Path) -> None:
    assert results(shown(f"{(site / 'index.html').as_uri()}?q=qzxqzxqzx", tmp_path)) == []
