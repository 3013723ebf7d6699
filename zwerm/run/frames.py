"""A run as pandas frames, in long form. pandas comes with the extra `frames`."""

from typing import TYPE_CHECKING, get_args

import numpy as np

from zwerm.errors import MissingExtraError
from zwerm.run.result import FrameKind, RunResult

if TYPE_CHECKING:
    from pandas import DataFrame


def frame_of(result: RunResult, kind: FrameKind) -> "DataFrame":
    """Return the frame that `RunResult.to_frame` describes."""
    if kind not in get_args(FrameKind):
        raise ValueError(f"to_frame: expected one of {', '.join(get_args(FrameKind))}, got {kind!r}")
    try:
        from pandas import DataFrame
    except ImportError as missing:
        raise MissingExtraError(f"to_frame needs pandas ({missing}): pip install 'zwerm[frames]'") from None
    if kind == "metrics":
        return DataFrame(result.series or {"time_s": np.zeros(0)})
    if kind == "telemetry":
        reported = result.telemetry
        columns = ("tick", "time_s", "node", "name", "value")
        return DataFrame({name: getattr(reported, name) for name in columns})
    poses = result.positions
    samples, robots = poses.present.shape
    return DataFrame(
        {
            "time_s": np.repeat(poses.time_s, robots),
            "node": np.tile(poses.node, samples),
            "x_m": poses.x_m.ravel(),
            "y_m": poses.y_m.ravel(),
            "heading_rad": poses.heading_rad.ravel(),
            "present": poses.present.ravel(),
        }
    )
