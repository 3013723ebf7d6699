"""Sensors of users: correct and defective ones."""

from typing import ClassVar

from zwerm.scenario.types import Positive, Table


class Thermometer:
    """The distance from the left wall, in a unit of its own."""

    field = "temperature"

    class Parameters(Table):
        unit_m: Positive

    def __init__(self, parameters, surroundings):
        self.unit_m = parameters.unit_m

    def read(self, scene, robots):
        return [(x / self.unit_m,) for x in scene.position[robots, 0].tolist()]


class Hygrometer:
    """Two numbers without meaning."""

    field = "humidity"
    Parameters: ClassVar[type[Table]] = Table

    def __init__(self, parameters, surroundings):
        pass

    def read(self, scene, robots):
        return [(0.5, float(robot)) for robot in robots]


class OwnLineOfSight(Hygrometer):
    """A user's replacement of a built-in sensor."""

    field = "line_of_sight"

    def read(self, scene, robots):
        return [True for _ in robots]


class Mailbox(Hygrometer):
    field = "inbox"


class Untyped(Hygrometer):
    Parameters = dict  # type: ignore[assignment]


class Lonely(Hygrometer):
    def __init__(self):
        pass


class Blind:
    field = "nothing"
