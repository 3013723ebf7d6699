"""Refuses the forks of controllers: the child would return from `step`, too, and answer for the same robot.

In a robot's process both would read from one connection, each a part of the messages, and the robot would fall silent. Inline
the child would be a second world. Commands that `subprocess` starts are no forks: they do not return to the controller.
"""

import sys
from types import FrameType
from typing import Final

from zwerm.agents.runtime import controllers, node

RULE: Final = "a controller must not fork, its robot would act twice: start a command by subprocess"

# The functions that call a controller: file and name.
ANSWERS: Final = ((node.__file__, "answer"),)
MAKERS: Final = ((controllers.__file__, "make"), (controllers.__file__, "find"))

_FORKS: Final = frozenset(("os.fork", "os.forkpty"))
_added: list[bool] = []


def refuse_forks(*, anywhere: bool = False) -> None:
    """Raise RuntimeError from now on in a controller that forks this process; `anywhere` means in all other code, too.

    Nothing can take the hook away. Only the first call in a process has an effect.
    """
    if _added:
        return
    _added.append(anywhere)
    forks = _FORKS

    def hook(event: str, _: object) -> None:
        if event in forks and (anywhere or _in_controller(sys._getframe(1))):
            raise RuntimeError(RULE)

    sys.addaudithook(hook)


def _in_controller(frame: FrameType | None) -> bool:
    while frame is not None:
        if (frame.f_code.co_filename, frame.f_code.co_name) in (*ANSWERS, *MAKERS):
            return True
        frame = frame.f_back
    return False
