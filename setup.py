"""Parts of the build that pyproject.toml cannot express: the page and the addresses of the package, links of a source
archive, a C extension.

The address of the project is where the built source tree comes from: its git remote `origin`. No file names it, so that a
fork's package leads to the fork.

`ZWERM_COMPILE=1` makes a C extension of one module (docs/how-to/running.md) with mypyc, which needs mypy and a C compiler.
`make setup` and cibuildwheel set it. The source stays the same, and so does every bit of what it computes: products and
sums are rounded one by one, as Python does it.
"""

import os
import re
import shutil
import subprocess
from email.parser import HeaderParser
from pathlib import Path

from setuptools import setup
from setuptools.command.sdist import sdist

HERE = Path(__file__).parent
# A remote on another host, as `https://host/path` or `user@host:path`; a host has a dot in its name.
REMOTE = re.compile(
    r"(?:(?:https|ssh|git)://(?:[^@/]+@)?|[\w.-]+@)(?P<host>[\w-]+(?:\.[\w-]+)*\.[a-z]+)(?::\d+)?[/:](?P<path>[\w./~-]+?)(?:\.git)?/?"
)

COMPILED = ["zwerm/maths/cached_voronoi_cell.py"]
# What it imports of the project. The types of other imports are not read: that would take five times the time.
READ = ["zwerm/maths/polygons.py"]
# The folders that zwerm/ holds links to.
PARTS = ("agents", "world", "coordinator", "deploy", "scenarios", "studies")


class SourceArchive(sdist):
    """A source archive that is laid out as the source tree, so that its tests run."""

    def make_release_tree(self, base_dir, files):
        """Copy the files, and put links in the place of the copies of what they lead to."""
        super().make_release_tree(base_dir, files)
        for part in PARTS:
            inside = Path(base_dir, "zwerm", part)
            if inside.is_dir() and not inside.is_symlink():
                shutil.rmtree(inside)
                inside.symlink_to(Path("..", part))


def description():
    """Return README.md without pictures, their announcements and links to files, which no page of a package index has."""
    text = (HERE / "README.md").read_text(encoding="utf-8")
    text = re.sub(r"^(?:[^\n]+:\n\n)?!\[[^]]*\]\((?!https?:)[^)]*\)\n+", "", text, flags=re.MULTILINE)
    return re.sub(r"\[([^]]*)\]\((?!https?:)([^)]*)\)", r"\1 (`\2`)", text)


def addresses():
    """Return the addresses of the project by name: those of its git remote, or those that a source archive was built with."""
    if (archive := HERE / "PKG-INFO").exists():
        found = HeaderParser().parsestr(archive.read_text(encoding="utf-8")).get_all("Project-URL", [])
        return dict(line.split(", ", 1) for line in found)
    # Only of this tree's own repository, not of one around it.
    if not (HERE / ".git").exists() or shutil.which("git") is None:
        return {}
    command = ["git", "-c", "safe.directory=*", "-C", str(HERE), "remote", "get-url", "origin"]
    remote = REMOTE.fullmatch(subprocess.run(command, capture_output=True, text=True).stdout.strip())
    if remote is None:
        return {}
    source = f"https://{remote['host']}/{remote['path']}"
    return {"Source": source, "Issues": f"{source}/issues"}


extensions = []
if os.environ.get("ZWERM_COMPILE") == "1":
    from mypyc.build import mypycify

    # Without the project's settings, by which mypy would check all of it.
    extensions = mypycify(["--config-file=", "--follow-imports=skip", *COMPILED, *READ], only_compile_paths=COMPILED)
    for extension in extensions:
        extension.extra_compile_args.append("-ffp-contract=off")

setup(
    ext_modules=extensions,
    cmdclass={"sdist": SourceArchive},
    long_description=description(),
    long_description_content_type="text/markdown",
    project_urls=addresses(),
)
