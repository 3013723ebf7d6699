"""Where robots come from: base stations with their depots.

A released robot does not say where it came out, so stations let robots out one after the other. A robot that came out
stands where its station stands and sees what that sees: this tells its heading.
"""

import math
from collections.abc import Collection, Mapping
from typing import Final

from zwerm.coordinator.post import Letter, Post, Story
from zwerm.frontier.places import Places
from zwerm.orders import Answer, Emerged, Release

# A depot is not empty because nobody came out: whoever did may have died at the door.
RELEASES_MAX: Final = 3


class Sources:
    """The stations, by place. `dry`: a depot that let nobody out; `blocked`: no robot gets away from there."""

    def __init__(self, bases: Collection[int], places: Places, post: Post, ticks_max: int) -> None:
        self.stations = {places.found(base): base for base in bases}
        self.waiting: dict[int, int] = {}  # place: the robot that came out there and has not gone yet
        self.dry: dict[int, None] = {}
        self.blocked: dict[int, None] = {}
        self.released = 0
        self._places = places
        self._post = post
        self._ticks_max = ticks_max
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
        answers: list[Letter] = []
        for _ in range(RELEASES_MAX):
            self._post.say(self.stations[base], Release(cycle))
            answers = yield from self._post.wait(self._is_new, 1, self._ticks_max)
            if answers:
                break
        self._busy = False
        for robot, answer in answers:
            if isinstance(answer, Emerged):
                self.released += 1
                self._places.take(robot, answer.sightings)
                self.waiting[base] = robot
                return robot
        self.dry[base] = None
        return None

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

    def _heading(self, robot: int, view: Mapping[int, float], moving: Collection[int]) -> float:
        place_of = self._places.place_of()
        x = y = 0.0
        for node, bearing in self._places.view[robot].items():
            place = place_of.get(node)
            if place is not None and place in view and (place not in moving or len(view) == 1):
                x += math.cos(view[place] - bearing)
                y += math.sin(view[place] - bearing)
        return math.atan2(y, x)
