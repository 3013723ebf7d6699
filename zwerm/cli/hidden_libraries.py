"""Files of the user that Python imports in place of a library, such as numpy.py or random.py in the working directory."""

import sys
from importlib.machinery import PathFinder
from pathlib import Path


def hidden_library(error: ImportError | AttributeError) -> str:
    """Return a line that names a file in the working directory that hides a library, or "" where none was imported."""
    folder = Path.cwd()
    elsewhere = [each for each in sys.path if each not in ("", str(folder))]
    failed = (error.name or "").partition(".")[0] if isinstance(error, ImportError) else ""
    for name in sorted({failed, *(each for each in sys.modules if "." not in each)} - {"", "zwerm"}):
        file = getattr(sys.modules.get(name), "__file__", None)
        if file is None or Path(file).parent not in (folder, folder / name):
            continue
        if name in sys.stdlib_module_names or PathFinder.find_spec(name, elsewhere) is not None:
            return f"{file} hides the library {name!r}: give it another name"
    return ""
