"""Followed stretches of wall and proved arcs, to messages that name robots, and from them."""

from collections.abc import Mapping

from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import FollowedStretch, StretchEnd
from zwerm.agents.sensor_coverage.messages.pushes import ProvedArc, WalkTriangle
from zwerm.agents.sensor_coverage.messages.walls import NeighbourProved, WallEnd, WallStretch


def message_of(stretch: FollowedStretch) -> WallStretch:
    """Return the message of a stretch whose ends name robots."""
    first, last = (WallEnd(*each) for each in (stretch.first, stretch.last))
    return WallStretch(stretch.first_number, stretch.last_number, first, last, stretch.radius_m)


def stretch_of(message: WallStretch, slots: Mapping[int, int]) -> FollowedStretch:
    """Return the stretch of a message, with the slots of robots, as far as known."""
    first, last = (
        StretchEnd(
            each.at,
            each.touched,
            tuple(slots[node] for node in each.robots if node in slots),
            tuple(slots[node] for node in each.seen if node in slots),
        )
        for each in (message.first, message.last)
    )
    return FollowedStretch(message.first_number, message.last_number, first, last, message.radius_m)


def proved_arc(message: NeighbourProved) -> ProvedArc:
    """Return the arc of a message."""
    needed, seen, start_rad, width_rad, triangle = message.arc
    return ProvedArc(needed, seen, start_rad, width_rad, None if triangle is None else WalkTriangle(*triangle))
