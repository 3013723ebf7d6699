"""The true poses of all robots over time."""

from dataclasses import dataclass

from zwerm.world.scene import Bools, Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Positions:
    """The true poses of n robots at k times. The pose of a robot that is not in the arena is nan.

    A scenario of less than 2,000 ticks has a sample at every tick. A longer one has samples at even intervals of at
    most a thousandth of its duration, and at the end.
    """

    time_s: Floats  # (k,) [s]
    node: Ints  # (n,)
    x_m: Floats  # (k, n) [m]
    y_m: Floats  # (k, n) [m]
    heading_rad: Floats  # (k, n) [rad], not wrapped
    present: Bools  # (k, n)
