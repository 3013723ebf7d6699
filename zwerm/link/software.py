"""The releases that decide what a node computes: a node joins a world over a network only with the same ones."""

import sys
from functools import cache
from typing import Final

from zwerm.version import __version__

# The software that computes and encodes. Their releases may differ in the last bits, or in the wire format.
_LIBRARIES: Final = ("numpy", "msgspec", "eclipse-zenoh")


@cache
def software() -> str:
    """Return the releases of Zwerm, Python and the libraries that compute and encode, in one line."""
    from importlib.metadata import version  # 30 modules and 2 MB, which robots on this machine do not need

    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return ", ".join([f"zwerm {__version__}", f"python {python}", *(f"{name} {version(name)}" for name in _LIBRARIES)])
