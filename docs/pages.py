"""Write the generated parts of the documentation into its pages: `python docs/pages.py`, or `--check` to compare only.

A part stands between a line `<!-- generated: NAME -->`, `<!-- described: NAME -->` or `<!-- measured: NAME -->` and a line
`<!-- end -->`. The first comes from the code (`_generate.py`), the second is a public name of it with signature and
docstring (`_described.py`), the third comes from a stored measurement (`_measured.py`). The pages are committed with these
parts filled in, so that they read well where nothing builds them; a test keeps them true.
"""

import argparse
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parent))

import _described
import _generate
import _measured

DOCS: Final = Path(__file__).parent
_KINDS: Final = "generated|described|measured"
MARK: Final = re.compile(
    rf"^<!-- ({_KINDS}): ([\w.-]+) -->$(?:(?:(?!^<!-- (?:{_KINDS}): ).)*?^<!-- end -->$)?",
    re.MULTILINE | re.DOTALL,
)


def pages() -> list[Path]:
    """Return every page of the documentation."""
    return sorted(DOCS.rglob("*.md"))


def marks(text: str) -> Iterator[tuple[str, str]]:
    """Yield the kind and the name of every part of a page."""
    for found in MARK.finditer(text):
        yield found[1], found[2]


def filled(text: str, page: Path) -> str:
    """Return a page with its parts made anew."""
    to_store = Path(os.path.relpath(_measured.STORE, page.parent)).as_posix()

    def part(found: re.Match[str]) -> str:
        kind, name = found[1], found[2]
        made = {
            "generated": lambda: _generate.GENERATED[name](),
            "described": lambda: _described.describe(name),
            "measured": lambda: _measured.render(name, to_store),
        }[kind]()
        return f"<!-- {kind}: {name} -->\n\n{made.strip()}\n\n<!-- end -->"

    return MARK.sub(part, text)


def main() -> None:
    parser = argparse.ArgumentParser(description="Write the generated parts of the documentation into its pages.")
    parser.add_argument("--check", action="store_true", help="write nothing; exit with 1 where a page is out of date")
    check = parser.parse_args().check
    failed = False
    for page in pages():
        name, text = page.relative_to(DOCS.parent), page.read_text(encoding="utf-8")
        try:
            new = filled(text, page)
        except KeyError as error:
            print(f"{name}: {error.args[0]}")
            failed = True
            continue
        if new != text:
            print(f"{name}: {'out of date, run: make pages' if check else 'written'}")
            failed |= check
            if not check:
                page.write_text(new, encoding="utf-8")
    sys.exit(failed)


if __name__ == "__main__":
    main()
