"""Controllers that print, hang, exit or crash together, for tests of the report of a run."""

import builtins
import ctypes
import os
import signal
import subprocess
import time
from multiprocessing.util import Finalize
from pathlib import Path

from msgspec import Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.wire.messages import Command, Observation, WheelSpeeds


class Prints(Controller):
    """Prints a line at every tick."""

    def step(self, observation: Observation) -> Command:
        print(f"I am {self.setup.node}")  # noqa: T201 - a newcomer's first means of debugging
        return Command(drive=WheelSpeeds(0.1, 0.1))


class Leaves(Controller):
    """Robot 2 ends its process with exit code 9 at tick 5."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 2 and observation.tick == 5:
            os._exit(9)
        return Command()


class AllRaise(Controller):
    """Every robot raises at tick 4, the ones with large ids first where they run as processes."""

    def step(self, observation: Observation) -> Command:
        if observation.tick == 4:
            raise ValueError("no way")
        return Command()


class HangsInline(Controller):
    """Robot 1 never answers the observation of tick 3, and catches every Exception."""

    def step(self, observation: Observation) -> Command:
        while self.setup.node == 1 and observation.tick == 3:
            try:
                sum(range(1_000))
            except Exception:
                continue
        return Command()


class Escapes(Controller):
    """Raises an error that would clear the terminal."""

    def step(self, observation: Observation) -> Command:
        raise ValueError("\x1b[2J gone")


class NoTextError(Exception):
    """An error whose text cannot be made."""

    def __str__(self) -> str:
        raise RuntimeError("no text")


class RaisesWithoutText(Controller):
    """Raises an error whose text cannot be made."""

    def step(self, observation: Observation) -> Command:
        raise NoTextError


class NeverMade(Controller):
    """Its constructor does not return, from an incarnation on."""

    made = 0

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        while setup.incarnation > self.made:
            pass

    def step(self, observation: Observation) -> Command:
        return Command()


class NeverMadeAgain(NeverMade):
    """Its constructor does not return after a restart."""

    made = 1


class Forks(Controller):
    """Starts three processes that never end, by fork, as a command and in a session of its own, and writes their ids."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 1 and observation.tick == 2:
            forked = ctypes.CDLL(None).fork()
            if forked == 0:
                signal.pause()
            command = subprocess.Popen(["sleep", "3600"])
            grouped = subprocess.Popen(["sleep", "3600"], start_new_session=True)
            Path(os.environ["FORKED"]).write_text(f"{forked} {command.pid} {grouped.pid}")
        return Command()


class ForksInStep(Controller):
    """Robot 1 forks at tick 3, and both processes go on."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 1 and observation.tick == 3:
            os.fork()
        return Command()


class ForksPastPython(Controller):
    """Robot 1 forks at tick 3 where Python does not see it, and both processes go on."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 1 and observation.tick == 3:
            ctypes.CDLL(None).fork()
        return Command()


class Interrupts(Controller):
    """Robot 1 raises KeyboardInterrupt at tick 3."""

    def step(self, observation: Observation) -> Command:
        if self.setup.node == 1 and observation.tick == 3:
            raise KeyboardInterrupt
        return Command()


class NotMade(Controller):
    """The constructor of robot 1 raises the error that is named."""

    class Parameters(Struct, frozen=True):
        """The name of an error of Python."""

        error: str = "SystemExit"

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        if setup.node == 1:
            raise getattr(builtins, self.parameters.error)

    def step(self, observation: Observation) -> Command:
        return Command()


class Lingers(Controller):
    """The process of robot 1 does not end by itself: it sleeps for a minute when it exits."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        if setup.node == 1:
            Finalize(None, time.sleep, (60.0,), exitpriority=1)

    def step(self, observation: Observation) -> Command:
        return Command()
