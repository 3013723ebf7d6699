"""One part of a study's trials, for one of several machines that share no scheduler of trials.

Every shard of a study plans all trials and runs its own. Each point's seeds are dealt to the shards in turn, so that shards
take about as long as each other.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from zwerm.errors import ScenarioError
from zwerm.study.trial_plan import Trial

_FORM: Final = re.compile(r"(auto|\d{1,6})/(auto|\d{1,6})")
_RULE: Final = "expected I/N with 1 <= I <= N, auto/N, or auto/auto in a Slurm array"


@dataclass(frozen=True)
class Shard:
    """Shard `index` of `count`, counted from 1."""

    index: int
    count: int

    def file(self, rows: Path) -> Path:
        """Return the file of this shard's rows beside the study's file `rows`."""
        return rows.with_name(f"{rows.stem}-shard-{self.index}-of-{self.count}{rows.suffix}")

    def of(self, trials: Sequence[Trial]) -> list[Trial]:
        """Return the trials of this shard, in the order of `trials`: any two shards differ by one trial at most."""
        points: dict[tuple[str, str], int] = {}
        numbers = [points.setdefault(trial.key[:2], len(points)) for trial in trials]
        # Point by point, so that each point's seeds are divided evenly, too.
        dealt = sorted(range(len(trials)), key=numbers.__getitem__)
        return [trials[index] for index in sorted(dealt[self.index - 1 :: self.count])]


def parse_shard(text: str, environment: Mapping[str, str]) -> Shard:
    """Return the shard of `--shard`. `auto` is the index or the number of tasks of a Slurm array or a Kubernetes indexed job.

    Kubernetes tells a pod its index and not the number of all. Raises ScenarioError.
    """
    matched = _FORM.fullmatch(text)
    if matched is None:
        raise ScenarioError([f"--shard: {_RULE}, got {text!r}"])
    index_text, count_text = matched.groups()
    found = _from_scheduler(environment)
    if "auto" in (index_text, count_text) and found is None:
        raise ScenarioError(
            [
                f"--shard {text}: auto needs SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX in the environment; neither is there"
            ]
        )
    index, known = found or (0, None)
    if count_text == "auto":
        if known is None:
            raise ScenarioError(
                [f"--shard {text}: a Kubernetes job does not name the number of its pods; give it: auto/N"]
            )
        count = known
    else:
        count = int(count_text)
    if index_text != "auto":
        index = int(index_text)
    if not 1 <= index <= count:
        raise ScenarioError([f"--shard: {_RULE}, got {index}/{count}"])
    return Shard(index, count)


def _from_scheduler(environment: Mapping[str, str]) -> tuple[int, int | None] | None:
    """Return the index from 1 and the number of tasks, if known, that the scheduler of this process gives; or None."""
    try:
        if "SLURM_ARRAY_TASK_ID" in environment:
            first = int(environment.get("SLURM_ARRAY_TASK_MIN", "1"))
            last = int(environment["SLURM_ARRAY_TASK_MAX"]) if "SLURM_ARRAY_TASK_MAX" in environment else None
            step = int(environment.get("SLURM_ARRAY_TASK_STEP", "1"))
            count = None if last is None else (last - first) // step + 1
            return (int(environment["SLURM_ARRAY_TASK_ID"]) - first) // step + 1, count
        if "JOB_COMPLETION_INDEX" in environment:
            return int(environment["JOB_COMPLETION_INDEX"]) + 1, None
    except (ValueError, ZeroDivisionError):
        raise ScenarioError(["--shard: expected whole numbers in the scheduler's variables"]) from None
    return None
