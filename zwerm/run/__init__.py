"""From a scenario to a result: assembly, the runners, the result, validation, and shrinking of fault schedules.

The package itself can be called: `zwerm.run(...)` is `zwerm.run.runner.run(...)`. The import system binds the name of a
package in its parent. A function of the same name would be replaced as soon as any module of the package is imported.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _Run(ModuleType):
    """The package, called as the function `run` of its module `runner`."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return import_module("zwerm.run.runner").run(*arguments, **options)

    def __reduce__(self) -> tuple[Any, ...]:
        return import_module, (__name__,)

    @property
    def __signature__(self) -> Any:
        from inspect import signature

        return signature(import_module("zwerm.run.runner").run)


sys.modules[__name__].__class__ = _Run
