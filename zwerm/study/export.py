"""Studies and comparisons as one JSON object each, with null for what is not known."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from zwerm.statistics import Sample
from zwerm.study.comparison import Comparison, Place
from zwerm.study.plan import Point
from zwerm.study.running import StudyResult
from zwerm.study.summary import Line


def study_json(result: StudyResult, drawn: Sequence[Path]) -> dict[str, Any]:
    """Return what a study has come to: every metric at every point, beside the paper's value where it has one."""
    results = result.results
    points = [
        {
            "variant": point.variant,
            "settings": dict(point.settings),
            "metrics": {metric: _line(results.line(point, metric)) for metric in results.study.table.metrics},
        }
        for point in results.points
    ]
    return _head(result, drawn) | {"points": points, "failures": dict(results.failures)}


def comparison_json(result: StudyResult, comparison: Comparison, drawn: Sequence[Path]) -> dict[str, Any]:
    """Return what a comparison has come to: every variant at every point, and its difference from the first."""
    return _head(result, drawn) | {
        "variants": comparison.variants,
        "metrics": comparison.metrics,
        "points": [_point(comparison, place, point) for place in comparison.places for point in place.points],
    }


def _head(result: StudyResult, drawn: Sequence[Path]) -> dict[str, Any]:
    return {
        "study": result.results.study.name,
        "planned": result.planned,
        "done": result.done,
        "ran": result.ran,
        "rows": str(result.path),
        "pictures": [str(each) for each in drawn],
    }


def _point(comparison: Comparison, place: Place, point: Point) -> dict[str, Any]:
    found: dict[str, Any] = {
        "variant": point.variant,
        "settings": dict(place.settings),
        "outcomes": dict(comparison.outcomes(point)),
        "metrics": {metric: _sample(comparison.sample(point, metric)) for metric in comparison.metrics},
    }
    if point is not place.points[0]:
        found["against"] = place.points[0].variant
        found["differences"] = {
            metric: _sample(comparison.difference(place, point, metric)) for metric in comparison.metrics
        }
    return found


def _line(line: Line) -> dict[str, Any]:
    found = _sample(line.sample)
    if line.published is not None:
        found |= {"paper": line.paper, "paper_is_bound": line.is_bound, "agrees": line.agrees}
    return found


def _sample(sample: Sample) -> dict[str, Any]:
    return sample._asdict()
