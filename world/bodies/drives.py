"""Drives: from the commands of robots to the velocities that their bodies track.

A commanded drive persists until the next one. It acts a fixed number of ticks after the observation it answers (the body's
actuation latency). Noise, drawn again for every tick, disturbs it; then it is clamped to the limits of the motors.
"""

from collections.abc import Mapping
from itertools import chain
from typing import Final

import msgspec
import numpy as np

from zwerm.catalogue import DRIVES
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.plugin_names import class_named
from zwerm.scenario.tables import BodyTable
from zwerm.wire.messages import BodyVelocity, WheelSpeeds
from zwerm.world.bodies import Drive, Velocities
from zwerm.world.scene import Floats

# Ticks of noise drawn at once. Draws are keyed by tick, so the size of a block changes only the cost.
_BLOCK_TICKS: Final = 64

# Up to this fraction of the robots, only the velocities of those whose command changed are computed.
_FEW_CHANGE: Final = 0.125


def find_drive(kind: str) -> type[Drive]:
    """Return the class that `kind` names. Raises ValueError, in one line, where there is none or it is no drive."""
    found = class_named(DRIVES.get(kind, kind), "drive", DRIVES)
    if not issubclass(found, Drive) or getattr(found, "command", None) not in (BodyVelocity, WheelSpeeds):
        raise ValueError(f"{kind} is no drive: expected a subclass of zwerm.Drive whose `command` is a type of drive")
    return found


class Drives:
    """The drives of `count` robots; `kind` is the type of drive that their body takes.

    `lagging` means that a command acts at the next tick or later.
    """

    def __init__(self, body: BodyTable, count: int, draws: Draws) -> None:
        self._body = body
        self._draws = draws
        self._drive = find_drive(body.kind)(body)
        self.kind = self._drive.command
        self._axes = len(self.kind.__struct_fields__)
        self._commanded: Floats = np.zeros((count, self._axes))
        self._everyone = list(range(count))
        self.lagging = body.latency_ticks > 0
        self._pending = [self._commanded.copy() for _ in range(body.latency_ticks - 1)]
        # Noise and latency change what acts at every tick, of every robot.
        self._lasting = self._drive.memoryless and not (body.drive_noise_fraction or self._pending)
        self._velocities: Velocities | None = None  # the newest ones, while they last
        self._changed: list[int] = []  # the robots whose command has changed since
        self._newest: dict[int, BodyVelocity | WheelSpeeds] = {}  # commands of some robots, as long as they last
        self._noise_block = -1
        self._noise: Floats = np.zeros((_BLOCK_TICKS, count, self._axes))

    def command(self, drives: Mapping[int, BodyVelocity | WheelSpeeds]) -> None:
        """Set the new drives of some robots, all of type `kind`."""
        if self._velocities is not None and len(drives) <= _FEW_CHANGE * len(self._commanded):
            newest = self._newest
            drives = {robot: drive for robot, drive in drives.items() if newest.get(robot) != drive}
            if not drives:
                return
            newest.update(drives)
            self._changed += drives
        elif self._velocities is not None:
            self._velocities = None
            self._newest.clear()
        axes, numbers = self._axes, chain.from_iterable(map(msgspec.structs.astuple, drives.values()))
        commanded = np.fromiter(numbers, np.float64, axes * len(drives)).reshape(-1, axes)
        robots = list(drives)
        if robots == self._everyone:
            self._commanded[:] = commanded
        else:
            self._commanded[robots] = commanded

    def stop(self, robot: int) -> None:
        """Stop a robot's motors from the next step on, and drop its commands that have not acted yet."""
        for pending in (self._commanded, *self._pending):
            pending[robot] = 0.0
        if self._lasting:
            self._changed.append(robot)
            self._newest.pop(robot, None)

    def velocities(self, tick: int) -> Velocities:
        """Return (forward [m/s], left [m/s] or None, turn [rad/s]), each (n,), for the step from `tick` to the next.

        Call it once a tick: before `command` where drives are `lagging`, after it otherwise. Arrays whose values may have
        changed are new ones: do not write to them.
        """
        if self._lasting:
            return self._lasting_velocities()
        if self._pending:
            self._pending.append(self._commanded.copy())
            acting = self._pending.pop(0)
        else:
            acting = self._commanded
        if self._body.drive_noise_fraction:
            acting = acting * self._noise_at(tick)
        return self._drive.velocities(acting)

    def _lasting_velocities(self) -> Velocities:
        last, robots = self._velocities, self._changed
        if last is not None and not robots:
            return last
        if last is None:
            found = self._drive.velocities(self._commanded)
        else:
            forward, left, turn = self._drive.velocities(self._commanded[robots])
            found = (
                _replaced(last[0], robots, forward),
                None if last[1] is None or left is None else _replaced(last[1], robots, left),
                _replaced(last[2], robots, turn),
            )
        self._velocities, self._changed = found, []
        return found

    def _noise_at(self, tick: int) -> Floats:
        block, offset = divmod(tick, _BLOCK_TICKS)
        if block != self._noise_block:
            ticks = np.arange(block * _BLOCK_TICKS, (block + 1) * _BLOCK_TICKS)[:, None, None]
            robots = np.arange(len(self._commanded))[:, None]
            draw = self._draws.uniform("drive-noise", robots, np.arange(self._axes), ticks)
            self._noise = 1.0 + self._body.drive_noise_fraction * (2.0 * draw - 1.0)
            self._noise_block = block
        noise: Floats = self._noise[offset]
        return noise


def _replaced(whole: Floats, rows: list[int], values: Floats) -> Floats:
    """Return a copy of `whole` (n,) with other values (k,) in some rows."""
    copy = whole.copy()
    copy[rows] = values
    return copy
