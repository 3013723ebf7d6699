"""The user's choices for pictures and animations: their size, their words, and the items drawn besides robots."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PictureStyle:
    """`size_in` is the greatest width and height [inches] of the arena in the picture; None for the default.

    A `bare` picture has no title, no numbers, no legend and no curve. `colour_by` names the telemetry by which robots
    are coloured, "" for none. `links` draws a line between robots if a packet between them has arrived.
    """

    size_in: tuple[float, float] | None = None
    bare: bool = False
    colour_by: str = ""
    links: bool = False
