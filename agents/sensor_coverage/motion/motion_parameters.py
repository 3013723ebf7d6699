"""Parameters of a robot's motion."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

Length = Annotated[float, Meta(gt=0.0, le=1000.0)]
Count = Annotated[int, Meta(ge=1)]


class RobotParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters that a scenario may set for a robot. `link_m` is r_v; neighbours stand `margin_m` closer.

    `walls` matters without a coordinator only, and has the meaning of the coordinator's parameter: with "followed" robots
    follow the walls before the deployment ends.
    """

    link_m: Length = 1.0
    margin_m: Length = 0.05
    samples: Count = 16
    first_samples: Count = 10
    tolerance_m: Length = 0.005
    creep_m: Length = 0.02
    fine_m: Length = 0.005
    stop_samples: Count = 12
    still_samples_max: Count = 48
    drive_ticks_max: Count = 90
    walls: Literal["paper", "followed"] = "followed"

    def __post_init__(self) -> None:
        """Raise ValueError unless `margin_m` is smaller than `link_m`."""
        if self.margin_m >= self.link_m:
            raise ValueError("expected margin_m < link_m")
