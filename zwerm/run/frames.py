"""A run as pandas frames, in long form. pandas comes with the extra `frames`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from zwerm.errors import MissingExtraError
from zwerm.run.positions import Positions
from zwerm.world.scene import Floats
from zwerm.world.tick.telemetry import TelemetryArrays

if TYPE_CHECKING:
    from pandas import DataFrame


FrameKind = Literal["positions", "metrics", "telemetry"]


def frame_of(
    kind: FrameKind, positions: Positions, series: Mapping[str, Floats], telemetry: TelemetryArrays
) -> "DataFrame":
    """Return the frame that `RunResult.to_frame` describes."""
    if kind not in get_args(FrameKind):
        raise ValueError(f"to_frame: expected one of {', '.join(get_args(FrameKind))}, got {kind!r}")
    try:
        from pandas import DataFrame
    except ImportError as missing:
        raise MissingExtraError(f"to_frame needs pandas ({missing}): pip install 'zwerm[frames]'") from None
    if kind == "metrics":
        return DataFrame(dict(series) or {"time_s": np.zeros(0)})
    if kind == "telemetry":
        columns = ("tick", "time_s", "node", "name", "value")
        return DataFrame({name: getattr(telemetry, name) for name in columns})
    samples, robots = positions.present.shape
    return DataFrame(
        {
            "time_s": np.repeat(positions.time_s, robots),
            "node": np.tile(positions.node, samples),
            "x_m": positions.x_m.ravel(),
            "y_m": positions.y_m.ravel(),
            "heading_rad": positions.heading_rad.ravel(),
            "present": positions.present.ravel(),
        }
    )
