"""Controllers that break the contract in one way, and the violations that the conformance kit finds."""

from collections.abc import Callable
from typing import Any

from zwerm.agents.conformance.check import ConformanceError, check
from zwerm.agents.runtime.contract import Controller
from zwerm.wire.messages import Command, Observation, WheelSpeeds


def violations(controller: Any, *arguments: Any, **options: Any) -> list[str]:
    try:
        check(controller, *arguments, **options)
    except ConformanceError as error:
        return error.violations
    return []


def stepping(step: Callable[[Any, Observation], Any], **attributes: Any) -> type[Controller]:
    """Return a controller that is correct except for `step`."""
    return type("Bad", (Controller,), {"step": step, **attributes})


def still(self: Any, observation: Observation) -> Command:
    return Command(drive=WheelSpeeds())
