"""The tutorial: every step does what the page says, in one folder, in order."""

from pathlib import Path

from support import ROOT
from walk import Reader, blocks

TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")


def test_every_step_of_the_tutorial_does_what_the_page_says(tmp_path: Path) -> None:
    reader = Reader(tmp_path)
    reader.follow(TUTORIAL)
    assert reader.folder == tmp_path / "consensus"
    assert reader.commands == sum(block.text.count("$ ") for block in blocks(TUTORIAL) if block.language == "console")
    assert list((reader.folder / "runs").glob("compare-meadow*.png")) != []
    assert (reader.folder / "meadow.png").stat().st_size > 10_000
