"""A study as one JSON object, with null for unknown numbers."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from zwerm.maths.statistics import Sample
from zwerm.study.study_runner import StudyResult
from zwerm.study.summary import SummaryLine


def study_json(result: StudyResult, drawn: Sequence[Path]) -> dict[str, Any]:
    """Return the result of a study: each metric at each point, with the paper's value if it has one."""
    results = result.results
    points = [
        {
            "variant": point.variant,
            "settings": dict(point.settings),
            "metrics": {metric: _line(results.line(point, metric)) for metric in results.study.table.metrics},
        }
        for point in results.points
    ]
    return study_head(result, drawn) | {"points": points, "failures": dict(results.failures)}


def study_head(result: StudyResult, drawn: Sequence[Path]) -> dict[str, Any]:
    """Return the part common to studies and comparisons: the numbers of trials, and the files written."""
    return {
        "study": result.results.study.name,
        "planned": result.planned,
        "done": result.done,
        "ran": result.ran,
        "rows": str(result.path),
        "pictures": [str(each) for each in drawn],
    }


def _line(line: SummaryLine) -> dict[str, Any]:
    found = sample_json(line.sample)
    if line.published is not None:
        found |= {"paper": line.paper, "paper_is_bound": line.is_bound, "agrees": line.agrees}
    return found


def sample_json(sample: Sample) -> dict[str, Any]:
    """Return a sample as a JSON object."""
    return sample._asdict()
