"""Zwerm emulates robot swarms as what they are: many processes that pass messages, with bit-identical runs.

`run` does what `zwerm run` does and returns a `RunResult`; `load` reads and checks a scenario. Both are imported when they
are first asked for, so that a robot's process does not carry what only the world needs.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from zwerm.version import __version__

if TYPE_CHECKING:
    from zwerm.run.result import RunResult as RunResult
    from zwerm.run.runner import run as run
    from zwerm.scenario.load import load as load

__all__ = ["RunResult", "__version__", "load", "run"]

_HOMES: Final = {"run": "zwerm.run.runner", "RunResult": "zwerm.run.result", "load": "zwerm.scenario.load"}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'zwerm' has no attribute {name!r}")
