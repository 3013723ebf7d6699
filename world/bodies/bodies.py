"""The bodies of one run: their poses, their drives, and their entry into and exit from the arena.

`scene` is the truth at the current tick. If drives act a tick or more after their command, the next scene does not
depend on the commands of this tick; `advance_early` then moves the bodies while the nodes still work.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import BodyVelocity, WheelSpeeds
from zwerm.world.arena.arena import Arena
from zwerm.world.arena.entrance import Depots, EntrySchedule
from zwerm.world.arena.placement import place
from zwerm.world.bodies.drives import Drives
from zwerm.world.bodies.physics import Physics
from zwerm.world.scene import Bools, Floats, Scene


class Passage(NamedTuple):
    """The robots that left and entered at the start of a tick."""

    left: list[int]
    entered: list[int]


class Bodies:
    """The bodies of all robots of a scenario. `exited` lists the robots that left, in order."""

    def __init__(self, scenario: Scenario, arena: Arena, draws: Draws) -> None:
        """Place the base stations, or the robots if none enter later. Raises ScenarioError where there is no room."""
        count, body, entrance = scenario.robots.count, scenario.robots.body, scenario.robots.entrance
        self.physics = Physics(body, arena.segments, count, scenario.time.dt_s)
        self.drives = Drives(body, count, draws)
        self.depots = Depots(scenario.base, count, arena, body.radius_m, draws) if scenario.base is not None else None
        self.exited: list[int] = []
        self._count = count
        self._dt_s = scenario.time.dt_s
        self._radius_m = body.radius_m
        self._arena = arena
        self._draws = draws
        self._present: Bools = np.zeros(count, dtype=np.bool_)
        self._entry = EntrySchedule(entrance, count) if entrance is not None else None
        self._next: Scene | None = None
        if self.depots is not None:
            for base in range(self.depots.stations):
                self.physics.fix(base, self.depots.position[base], float(self.depots.heading[base]))
                self._set_present(base, True)
        elif self._entry is None:
            placement = scenario.robots.placement
            if placement.kind == "roots":
                from zwerm.world.arena.grid_maps import root_placement  # slow to import, and few arenas are maps

                placement = root_placement(placement, scenario.arena, scenario.folder, count)
            positions, headings = place(placement, arena, count, body.radius_m, draws)
            for robot in range(count):
                self._add(robot, positions[robot], float(headings[robot]))
        self.scene = self._scene(np.ones(count, dtype=np.bool_), 0)

    def drive(self, drives: Mapping[int, BodyVelocity | WheelSpeeds]) -> None:
        """Set the new drives of some robots."""
        self.drives.command(drives)

    def stop(self, node: int) -> None:
        """Stop the motors of a robot until its next command; nodes without a body are ignored."""
        if node < self._count:
            self.drives.stop(node)

    def release(self, node: int) -> None:
        """Let the next robot out of a base station's depot; other nodes release no robot."""
        if self.depots is not None and node < self.depots.stations:
            self.depots.release(node)

    def advance_early(self) -> Scene | None:
        """Move the bodies to the next tick, once, if no command of this tick acts before it; return the next scene."""
        if self.drives.lagging and self._next is None:
            self._next = self._moved()
        return self._next

    def advance(self) -> None:
        """Make the next tick the current one, moving the bodies unless `advance_early` has."""
        self.scene, self._next = self._next or self._moved(), None

    def pass_entrance(self) -> Passage:
        """Let robots leave and enter at the start of a tick."""
        entrance = self._entry or self.depots
        if entrance is None:
            return Passage([], [])
        left: list[int] = entrance.leaving(self.scene).tolist()
        for robot in left:
            self.physics.remove(robot)
            self._set_present(robot, False)
            self.exited.append(robot)
        entering = entrance.entering(self.scene)
        entered: list[int] = []
        if entering is not None:
            self._add(*entering)
            entered = [entering[0]]
        if left or entered:
            changed = self.scene.moved.copy()
            changed[[*left, *entered]] = True
            self.scene = self._scene(changed, self.scene.tick)
        return Passage(left, entered)

    def _moved(self) -> Scene:
        tick = self.scene.tick
        return self._scene(self.physics.advance(*self.drives.velocities(tick)), tick + 1)

    def _scene(self, moved: Bools, tick: int) -> Scene:
        return Scene(
            tick,
            tick * self._dt_s,
            self.physics.position.copy(),
            self.physics.heading.copy(),
            self._present,
            moved,
            self._radius_m,
            self._arena,
            self._draws,
        )

    def _add(self, robot: int, position: Floats, heading: float) -> None:
        self.physics.add(robot, position, heading)
        self._set_present(robot, True)

    def _set_present(self, robot: int, present: bool) -> None:
        self._present = self._present.copy()  # scenes of earlier ticks keep theirs
        self._present[robot] = present
