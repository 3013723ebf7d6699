"""A comparison as one JSON object, with null for unknown numbers."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from zwerm.compare.comparison import Comparison, SweepPoint
from zwerm.study.export import sample_json, study_head
from zwerm.study.study_runner import StudyResult
from zwerm.study.trial_plan import Point


def comparison_json(result: StudyResult, comparison: Comparison, drawn: Sequence[Path]) -> dict[str, Any]:
    """Return the result of a comparison: each variant at each point, and its difference from the first."""
    return study_head(result, drawn) | {
        "variants": comparison.variants,
        "metrics": comparison.metrics,
        "points": [_point(comparison, place, point) for place in comparison.places for point in place.points],
    }


def _point(comparison: Comparison, place: SweepPoint, point: Point) -> dict[str, Any]:
    found: dict[str, Any] = {
        "variant": point.variant,
        "settings": dict(place.settings),
        "outcomes": dict(comparison.outcomes(point)),
        "metrics": {metric: sample_json(comparison.sample(point, metric)) for metric in comparison.metrics},
    }
    if point is not place.points[0]:
        found["against"] = place.points[0].variant
        found["differences"] = {
            metric: sample_json(comparison.difference(place, point, metric)) for metric in comparison.metrics
        }
    return found
