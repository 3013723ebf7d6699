"""A leg of a walk that leads along the same walls as the walk before: it proves nothing more, and the walk ends."""

import math

from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.coordinator.sensor_coverage.wall_walks import leads_again

EAST, WEST = 0.0, math.pi


def in_touch(y_m: float, *walls: float) -> Waypoint:
    """Return a point of a way to the north along walls in these directions [rad]."""
    return Waypoint(0.0, y_m, (), walls, ())


def test_a_leg_leads_again_where_all_its_places_in_touch_are_known() -> None:
    way = [in_touch(0.1 * each, EAST) for each in range(10)]
    again = [in_touch(0.1 * each + 0.02, EAST + 0.5) for each in range(5)]
    assert leads_again(way, [*again, in_touch(2.0)]), "a point without a contact is no news"
    assert not leads_again(way, [*again, in_touch(0.94, EAST)]), "farther along the wall"
    assert not leads_again(way, [*again, in_touch(0.3, WEST)]), "at the opposite wall of the passage"
    assert not leads_again(way, [in_touch(0.3)]), "without a contact nothing shows where it led"
    assert not leads_again([], again)
