"""Sources of robots: base stations with their depots.

A released robot does not report at which station it came out, so stations release robots one after the other. A robot
that has come out stands at its station's point and sees the same directions. This determines its heading.
"""

import math
from collections.abc import Collection, Mapping
from typing import Final

from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import (
    Answer,
    Emerged,
    Release,
    Released,
    Report,
    ScanRequest,
    Sighting,
)
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox, Routine

# A depot counts as empty only after this many releases: a released robot may have died before it reported.
RELEASES_MAX: Final = 3
# Ticks within which a released robot reports, unless its report was lost.
EMERGENCE_TICKS_MAX: Final = 30


class Sources:
    """The stations by slot.

    `waiting` has the robot that came out at a station and has not gone yet, by the station's slot. `empty` depots
    released no robot. No robot gets away from a `blocked` station. `out` are all robots that were ever outside.
    """

    def __init__(self, bases: Collection[int], slots: Slots, mailbox: CommandMailbox) -> None:
        self.stations = {slots.add(base): base for base in bases}
        self.waiting: dict[int, int] = {}
        self.empty: dict[int, None] = {}
        self.blocked: dict[int, None] = {}
        self.out: dict[int, None] = {}
        self._slots = slots
        self._mailbox = mailbox
        self._releasing = False

    def available(self) -> list[int]:
        """Return the slots of the stations from which robots can come."""
        return [
            slot
            for slot in self.alive()
            if slot not in self.blocked and (slot not in self.empty or slot in self.waiting)
        ]

    def slot_of(self, robot: int) -> int | None:
        """Return the slot of a station, or None for a robot that is none."""
        return next((slot for slot, base in self.stations.items() if base == robot), None)

    def alive(self) -> list[int]:
        """Return the slots of the stations that answer."""
        return [slot for slot in self.stations if slot in self._slots.occupant]

    def release(self, base: int, cycle: int) -> Routine[int | None]:
        """Return the robot that waits at a station, or release one; None if the depot is empty."""
        if base in self.waiting:
            return self.waiting[base]
        while self._releasing:
            yield from self._mailbox.pause()
        self._releasing = True
        for _ in range(RELEASES_MAX):
            robot = yield from self._release_one(self.stations[base], cycle)
            if robot is not None:
                self._releasing = False
                self.waiting[base] = robot
                return robot
        self._releasing = False
        self.empty[base] = None
        return None

    def _release_one(self, station: int, cycle: int) -> Routine[int | None]:
        """Release a robot, and return it once it has reported; None if no robot came out, or it died."""
        self._mailbox.send(station, Release(cycle))
        received = yield from self._mailbox.first(
            lambda node, answer: self._is_new(node, answer) or (node == station and isinstance(answer, Released)),
            station,
        )
        if received is None:
            return None
        robot, answer = received
        if isinstance(answer, Released):
            if answer.robot is None:
                return None
            robot = answer.robot
            self.out[robot] = None
            return (yield from self._first_report(robot, cycle))
        self._mailbox.cancel(station)
        return self._admit(robot, answer.sightings if isinstance(answer, Emerged) else ())

    def _first_report(self, robot: int, cycle: int) -> Routine[int | None]:
        """Wait until a released robot reports, and ask it if its report may have been lost."""
        received = None
        if not self._mailbox.retry_policy.lossy:
            received = yield from self._mailbox.first(
                lambda node, answer: node == robot and isinstance(answer, Emerged), robot, EMERGENCE_TICKS_MAX
            )
        if received is None:
            self._mailbox.send(robot, ScanRequest(cycle, ()))
            received = yield from self._mailbox.first(
                lambda node, answer: node == robot and isinstance(answer, Emerged | Report), robot
            )
        if received is None:
            return None
        self._mailbox.cancel(robot)
        answer = received[1]
        return self._admit(robot, answer.sightings or () if isinstance(answer, Emerged | Report) else ())

    def _admit(self, robot: int, sightings: Collection[Sighting]) -> int:
        self.out[robot] = None
        self._slots.take(robot, sightings)
        return robot

    def _is_new(self, node: int, answer: Answer) -> bool:
        return isinstance(answer, Emerged) and self.slot_of(node) is None and node not in self._slots.heading

    def let_out(self, base: int, cycle: int, view: Mapping[int, float], moving: Collection[int]) -> Routine[None]:
        """Have a robot wait at a station, unless one does, and find its heading from the station's view.

        The robots at the slots in `moving` may be moving.
        """
        if base in self.waiting:
            return
        robot = yield from self.release(base, cycle)
        if robot is not None:
            frame = self._slots.frame[self.stations[base]]
            self._slots.orient(robot, frame, self._heading(robot, view, moving))

    def station_seeing(self, robot: int) -> int | None:
        """Return the slot of the station that sees a robot which has not left it."""
        slots = self._slots
        return next((slot for slot in self.alive() if robot in slots.view.get(self.stations[slot], ())), None)

    def adopt(self, robot: int, base: int, sightings: Collection[Sighting], view: Mapping[int, float]) -> None:
        """Have a robot wait that was found at a station with this view, unless another robot waits there."""
        if base not in self.waiting:
            self.waiting[base] = self._admit(robot, sightings)
            self._slots.orient(robot, self._slots.frame[self.stations[base]], self._heading(robot, view, ()))

    def _heading(self, robot: int, view: Mapping[int, float], moving: Collection[int]) -> float:
        """Return the heading [rad] that makes a robot's bearings agree with its station's view."""
        slot_of = self._slots.slot_of()
        x = y = 0.0
        for node, bearing in self._slots.view[robot].items():
            slot = slot_of.get(node)
            if slot is not None and slot in view and (slot not in moving or len(view) == 1):
                x += math.cos(view[slot] - bearing)
                y += math.sin(view[slot] - bearing)
        return math.atan2(y, x)
