"""The recipes: each works from an empty folder as it stands on the page, and names tables of the catalogue that exist."""

import re
from pathlib import Path

import pytest
from support import ROOT
from walk import FILE, Reader, blocks, part

from zwerm import catalogue

RECIPES = (ROOT / "docs" / "how-to" / "recipes.md").read_text(encoding="utf-8")
ROWS = "A row of the catalogue"
HEADINGS = [heading for heading in re.findall(r"^## (.*)$", RECIPES, re.MULTILINE) if heading != ROWS]


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_recipe_works_from_an_empty_folder_as_it_stands(tmp_path: Path, heading: str) -> None:
    reader = Reader(tmp_path)
    reader.follow(part(RECIPES, heading))
    assert reader.commands >= 1


def test_every_kind_of_plug_in_has_a_recipe() -> None:
    kinds = {heading.removeprefix("A ").removeprefix("An ").split(" with ")[0] for heading in HEADINGS}
    assert kinds >= set(catalogue.plugins()) | {"metric", "picture layer", "algorithm"}


def test_recipes_and_the_tutorial_import_nothing_of_zwerm_but_its_public_names() -> None:
    pages = [RECIPES, (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")]
    files = [block.text for page in pages for block in blocks(page) if FILE.fullmatch(block.title)]
    assert len(files) > 10
    assert [line for text in files for line in text.splitlines() if re.match(r"\s*(from|import) zwerm\.", line)] == []


def test_the_tables_and_folders_of_the_catalogue_are_those_that_exist() -> None:
    table = [line.split("|")[1:4] for line in part(RECIPES, ROWS).splitlines() if re.match(r"\| \w.*`", line)]
    assert len(table) == len(HEADINGS)
    for _, folders, names in table:
        assert hasattr(catalogue, re.findall(r"`(\w+)`", names)[0]), names
        for folder in re.findall(r"`([\w/]+)/`", folders):
            assert (ROOT / folder.removesuffix("/NAME")).is_dir(), folder
