"""The test helper that follows a page: it fails if a statement of the page is wrong."""

from pathlib import Path

import pytest
from walk import Reader, part

FENCE = "```"


def block(language: str, text: str) -> str:
    return f"{FENCE}{language}\n{text}\n{FENCE}\n"


def test_files_are_saved_and_commands_run_in_order_in_one_shell(tmp_path: Path) -> None:
    page = block("console", "$ mkdir there && cd there") + block('py title="a.py"', "print(6 * 7)")
    reader = Reader(tmp_path)
    reader.follow(page + block("console", "$ python a.py\nthis line is no command") + block("text", "42"))
    assert reader.folder == tmp_path / "there"
    assert reader.commands == 2


@pytest.mark.parametrize(
    ("page", "message"),
    [
        (block("console", "$ false"), r"line 1: \$ false"),
        (block('console title="Exit status 1"', "$ true"), r"line 1: \$ true"),
        (block("console", "$ echo 4 1") + block("text", "4 2"), "line 4: not printed: 4 2"),
        (block("console", "$ echo old") + block("console", "$ echo new") + block("text", "old"), "not printed: old"),
    ],
)
def test_a_statement_of_a_page_that_is_not_true_is_reported_with_its_line(
    tmp_path: Path, page: str, message: str
) -> None:
    with pytest.raises(AssertionError, match=message):
        Reader(tmp_path).follow(page)


def test_a_part_of_a_page_ends_at_the_next_heading() -> None:
    assert part("\n## A\n\na\n\n### b\n\n## C\n\nc\n", "A").split() == ["a", "###", "b"]
