"""The site: its pages are in the navigation, its pictures are small, and its links lead somewhere."""

import re
from importlib import import_module
from pathlib import Path

import pytest
import yaml
from PIL import Image
from support import ROOT, script

import zwerm
from zwerm.scenario.load import built_in

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
ROOT_PAGES = [ROOT / name for name in ("CONTRIBUTING.md", "SECURITY.md")]
LINK = re.compile(r"!?\]\(<?(?!https?:)([^)#>]+)>?(?:#[^)]*)?\)")
PICTURE_BYTES_MAX = 150_000


def pages_of(nav: object) -> list[str]:
    """Return the pages of a navigation tree."""
    if isinstance(nav, str):
        return [nav]
    parts = nav.values() if isinstance(nav, dict) else nav
    return [page for part in parts for page in pages_of(part)]  # type: ignore[attr-defined]


def test_every_page_is_in_the_navigation_once() -> None:
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    nav = yaml.safe_load(text.split("\nnav:\n")[1].split("\n\n")[0])
    assert sorted(pages_of(nav)) == sorted(page.relative_to(DOCS).as_posix() for page in PAGES)


@pytest.mark.parametrize("page", [*PAGES, *ROOT_PAGES], ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_of_a_page_leads_to_a_file(page: Path) -> None:
    prose = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    assert [target for target in LINK.findall(prose) if not (page.parent / target).exists()] == []


def test_every_picture_of_the_gallery_is_small_has_a_palette_and_belongs_to_a_scenario() -> None:
    pictures = sorted((DOCS / "images" / "gallery").glob("*.png"))
    assert len(pictures) > 10
    assert {picture.stem for picture in pictures} <= set(built_in())
    for picture in pictures:
        assert picture.stat().st_size <= PICTURE_BYTES_MAX, picture.name
        with Image.open(picture) as image:
            assert image.mode == "P", picture.name


def test_a_picture_of_the_gallery_is_drawn_by_its_script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gallery = script(DOCS / "gallery.py")
    monkeypatch.setattr(gallery, "FOLDER", tmp_path)
    path = gallery.draw("gossip-max")
    assert path == tmp_path / "gossip-max.png"
    assert 10_000 < path.stat().st_size <= gallery.BYTES_MAX


@pytest.mark.parametrize("page", [*PAGES, *ROOT_PAGES, ROOT / "README.md"], ids=lambda page: page.name)
def test_a_page_is_plain_markdown_that_a_code_host_renders(page: Path) -> None:
    """Directives, admonitions and attributes of a generator would stand there as they are written."""
    text = re.sub(r"^```.*?^```$|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    assert re.findall(r"^(?::::|!!!|\?\?\?|===|--8<--).*|\{[:#].*?\}|\[[^]]+\]\[[^]]*\]", text, re.MULTILINE) == []


def test_every_public_name_is_described() -> None:
    described = "".join(
        (DOCS / name).read_text(encoding="utf-8") for name in ("reference/api.md", "reference/protocol.md")
    )
    errors = {name for name in zwerm.__all__ if name.endswith("Error")}
    own = {"zwerm.run.runner.run", "zwerm.errors"} | {f"zwerm.{name}" for name in zwerm.__all__}
    named = set(re.findall(r"^<!-- described: ([\w.]+) -->$", described, re.MULTILINE))
    assert named <= own
    assert [
        name
        for name in sorted(set(zwerm.__all__) - errors - {"__version__", "run", "Scenario", "Table"})
        if f"zwerm.{name}" not in named and not re.search(rf"^### {name}$", described, re.MULTILINE)
    ] == []


def test_the_citation_names_the_five_papers_and_the_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["authors"] == [{"name": "The Zwerm developers"}]
    assert sorted(paper["year"] for paper in citation["references"]) == [2002, 2006, 2015, 2018, 2019]
    assert citation.get("version", zwerm.__version__) == zwerm.__version__


def test_every_module_that_a_page_names_exists() -> None:
    """Names such as `zwerm.maths.angles` in prose, also with a class or function at their end."""
    name = re.compile(r"`(zwerm(?:\.[a-z_]\w*)+(?:\.[A-Z]\w*)?)")
    named = [
        (page.name, each) for page in PAGES for each in sorted(set(name.findall(page.read_text(encoding="utf-8"))))
    ]
    assert [(page, each) for page, each in named if not exists(each)] == []


def exists(name: str) -> bool:
    """Return whether a dotted name is a module, or an attribute of one."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found: object = import_module(".".join(parts[:count]))
        except ImportError:
            continue
        try:
            for part in parts[count:]:
                found = getattr(found, part)
        except AttributeError:
            return False
        return True
    return False
