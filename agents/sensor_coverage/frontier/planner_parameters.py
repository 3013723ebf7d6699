"""Parameters of the frontier planner and of the coordinator."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

Length = Annotated[float, Meta(gt=0.0, le=1000.0)]
Count = Annotated[int, Meta(ge=1)]


class PlannerParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters that a scenario may set for the coordinator.

    `link_m` is r_v of the paper, and neighbours stand `margin_m` closer; both must agree with the robots' parameters.
    The deployment does not end before `watch_until_s`. With `walls` "paper" two touches or failed drives make an edge an
    obstacle; with "followed" robots follow the walls before the deployment ends.
    """

    link_m: Length = 1.0
    margin_m: Length = 0.05
    clear_m: Length = 0.8
    clear_vertex_m: Length = 0.9
    clear_end_m: Length = 0.6
    near_wall_m: Length = 0.3
    obstacle_cost: Annotated[float, Meta(ge=1.0, le=1000.0)] = 3.0
    corner_margin_rad: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.15
    redundancy_every: Annotated[int, Meta(ge=0)] = 10
    attempts_max: Count = 2
    pushes_max: Count = 100
    survey_ticks_max: Count = 80
    drive_ticks_max: Count = 300
    cycles_max: Count = 2000
    walls: Literal["paper", "followed"] = "followed"
    watch_until_s: Annotated[float, Meta(ge=0.0)] = 0.0

    def __post_init__(self) -> None:
        """Raise ValueError unless `margin_m` is smaller than `link_m`."""
        if self.margin_m >= self.link_m:
            raise ValueError("expected margin_m < link_m")

    @property
    def hop_m(self) -> float:
        """Distance [m] between two neighbouring slots."""
        return self.link_m - self.margin_m
