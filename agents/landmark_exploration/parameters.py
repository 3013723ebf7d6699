"""Parameters of landmark-based exploration."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from zwerm.agents.landmark_exploration.sharing.landmark_messages import LARGE_BYTES, SMALL_BYTES

Ticks = Annotated[int, Meta(ge=1, le=1_000_000)]
MessageBytes = Annotated[int, Meta(ge=SMALL_BYTES, le=LARGE_BYTES)]
NonNegative = Annotated[float, Meta(ge=0.0)]

# Strategies of robots that choose frontiers themselves, and of a coordinator that assigns them.
Strategy = Literal["cost-utility", "nearest-frontier", "random-walk"]
CentralStrategy = Literal["cost-utility", "nearest-frontier", "min-pos"]


class ExplorerParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """The robots' parameters; those of choosing frontiers count where robots choose by themselves.

    `beta` weighs the cost against the utility. A robot has `cross_ticks` to cross the line of a frontier, and `search_ticks` to
    search behind it (minimal effort: 1). `message_bytes_max` caps every radio message. A claim is void when its robot has
    been silent for `lease_ticks`; a robot silent for `dead_ticks` is presumed dead. A robot without an open frontier for
    `freeze_ticks` freezes: it adds no entry to the map. `robots_expected` robots must agree that exploration is complete. A
    robot that never sent a message counts as silent from the start. `turn_sd_rad` is the deviation of the random walk's turn
    in a tick. With `look_idle` a robot without a frontier walks about, and adds what it sees to the map until it freezes or
    is halted. Without it the map is less complete, and large halls take less time. With `presence_only` no bearing is used:
    robots know which landmarks they see, and stop when no observation was new for `stagnation_ticks`.
    """

    beta: NonNegative = 10.0
    strategy: Strategy = "cost-utility"
    cross_ticks: Ticks = 40
    search_ticks: Ticks = 20
    message_bytes_max: MessageBytes = LARGE_BYTES
    lease_ticks: Ticks = 300
    dead_ticks: Ticks = 1_500
    freeze_ticks: Ticks = 40
    robots_expected: Annotated[int, Meta(ge=1, le=100_000)] = 1
    turn_sd_rad: NonNegative = 0.05
    look_idle: bool = True
    presence_only: bool = False
    stagnation_ticks: Ticks = 60
