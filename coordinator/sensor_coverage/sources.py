"""Where robots come from: base stations with their depots.

A released robot does not say where it came out, so stations let robots out one after the other. A robot that came out
stands where its station stands and sees what that sees: this tells its heading.
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
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox, Story

# A depot is not empty because nobody came out: whoever did may have died at the door.
RELEASES_MAX: Final = 3
# Who has come out says so within these [ticks], unless that got lost.
EMERGENCE_TICKS: Final = 30


class Sources:
    """The stations, by place. `dry`: a depot that let nobody out; `blocked`: no robot gets away from there."""

    def __init__(self, bases: Collection[int], places: Slots, post: CommandMailbox) -> None:
        self.stations = {places.found(base): base for base in bases}
        self.waiting: dict[int, int] = {}  # place: the robot that came out there and has not gone yet
        self.dry: dict[int, None] = {}
        self.blocked: dict[int, None] = {}
        self.out: dict[int, None] = {}  # everyone who was ever outside
        self._places = places
        self._post = post
        self._busy = False

    def open(self) -> list[int]:
        """Return the places where robots may come from."""
        return [
            place
            for place in self.alive()
            if place not in self.blocked and (place not in self.dry or place in self.waiting)
        ]

    def place_of(self, robot: int) -> int | None:
        """Return the place of a station, or None for a robot that is none."""
        return next((place for place, base in self.stations.items() if base == robot), None)

    def alive(self) -> list[int]:
        """Return the places of the stations that answer."""
        return [place for place in self.stations if place in self._places.occupant]

    def release(self, base: int, cycle: int) -> Story[int | None]:
        """Return the robot that waits at a station, or else let one out; None from a depot that is empty."""
        if base in self.waiting:
            return self.waiting[base]
        while self._busy:
            yield from self._post.pause()
        self._busy = True
        for _ in range(RELEASES_MAX):
            robot = yield from self._newborn(self.stations[base], cycle)
            if robot is not None:
                self._busy = False
                self.waiting[base] = robot
                return robot
        self._busy = False
        self.dry[base] = None
        return None

    def _newborn(self, station: int, cycle: int) -> Story[int | None]:
        """Let a robot out, and return it once it has said what it sees; None if nobody came, or nobody that lives."""
        self._post.say(station, Release(cycle))
        letter = yield from self._post.first(
            lambda node, answer: self._is_new(node, answer) or (node == station and isinstance(answer, Released)),
            station,
        )
        if letter is None:
            return None
        robot, answer = letter
        if isinstance(answer, Released):
            if answer.robot is None:
                return None
            robot = answer.robot
            self.out[robot] = None
            return (yield from self._seeing(robot, cycle))
        self._post.close(station)
        return self._born(robot, answer.sightings if isinstance(answer, Emerged) else ())

    def _seeing(self, robot: int, cycle: int) -> Story[int | None]:
        """Wait until a robot that came out says what it sees, and ask it if that may have got lost."""
        letter = None
        if not self._post.patience.lossy:
            letter = yield from self._post.first(
                lambda node, answer: node == robot and isinstance(answer, Emerged), robot, EMERGENCE_TICKS
            )
        if letter is None:
            self._post.say(robot, ScanRequest(cycle, ()))
            letter = yield from self._post.first(
                lambda node, answer: node == robot and isinstance(answer, Emerged | Report), robot
            )
        if letter is None:
            return None
        self._post.close(robot)
        answer = letter[1]
        return self._born(robot, answer.sightings or () if isinstance(answer, Emerged | Report) else ())

    def _born(self, robot: int, sightings: Collection[Sighting]) -> int:
        self.out[robot] = None
        self._places.take(robot, sightings)
        return robot

    def _is_new(self, node: int, answer: Answer) -> bool:
        return isinstance(answer, Emerged) and self.place_of(node) is None and node not in self._places.heading

    def let_out(self, base: int, cycle: int, view: Mapping[int, float], moving: Collection[int]) -> Story[None]:
        """Have a robot wait at a station that has this view, its heading known, unless one does; some places may be moving."""
        if base in self.waiting:
            return
        robot = yield from self.release(base, cycle)
        if robot is not None:
            frame = self._places.frame[self.stations[base]]
            self._places.orient(robot, frame, self._heading(robot, view, moving))

    def door(self, robot: int) -> int | None:
        """Return the place of the station that sees a robot which has not left."""
        places = self._places
        return next((place for place in self.alive() if robot in places.view.get(self.stations[place], ())), None)

    def adopt(self, robot: int, base: int, sightings: Collection[Sighting], view: Mapping[int, float]) -> None:
        """Have a robot wait that was found at a station which has this view, unless one does."""
        if base not in self.waiting:
            self.waiting[base] = self._born(robot, sightings)
            self._places.orient(robot, self._places.frame[self.stations[base]], self._heading(robot, view, ()))

    def _heading(self, robot: int, view: Mapping[int, float], moving: Collection[int]) -> float:
        place_of = self._places.place_of()
        x = y = 0.0
        for node, bearing in self._places.view[robot].items():
            place = place_of.get(node)
            if place is not None and place in view and (place not in moving or len(view) == 1):
                x += math.cos(view[place] - bearing)
                y += math.sin(view[place] - bearing)
        return math.atan2(y, x)
