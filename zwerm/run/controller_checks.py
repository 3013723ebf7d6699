"""Controllers in the world's process: checked before robots start in processes of their own, and made again inline."""

from collections.abc import Mapping

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.runtime.controllers import make
from zwerm.agents.runtime.node import Node
from zwerm.errors import ScenarioError
from zwerm.run.hang_guard import constructors_guarded


def try_controllers(specs: Mapping[int, tuple[str, Setup]], trusted: bool = True) -> None:
    """Check the controller of each node by `specs`, its name and its setup; make one of each kind if they are `trusted`.

    Raises ScenarioError for a controller in the program itself, which the processes of robots do not run, and
    ControllerError for one that cannot be made, which each robot's process would report apart.
    """
    firsts: dict[str, Setup] = {}
    for name, setup in specs.values():
        firsts.setdefault(name, setup)
    for name in firsts:
        if name.startswith("__main__:"):
            rule = "robot processes do not import the program itself: move the class to a module, or run inline"
            raise ScenarioError([f"{name}: {rule}"])
    if trusted:
        with constructors_guarded():
            for name, setup in firsts.items():
                make(name, setup)


def make_again(controller: str, setup: Setup) -> Node:
    """Return a node that is made while an inline run goes on. Raises ControllerError where that takes too long."""
    with constructors_guarded():
        return Node(controller, setup)
