"""A study on several machines: its shards and their merging, the order of its trials, and a Dask cluster."""

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
import yaml
from study_files import DEADLINE_S, GRID, TINY, run_here
from support import ROOT
from waiting import until

from zwerm.errors import LinkError, ScenarioError
from zwerm.study.distribute.merging import merge_files
from zwerm.study.distribute.shard import Shard, parse_shard
from zwerm.study.rows import key_of, read_rows
from zwerm.study.study_runner import run_study
from zwerm.study.study_tables import Study
from zwerm.study.trial_order import in_order
from zwerm.study.trial_plan import Trial, make_points, make_trials


def trials_of(study: Study, seeds: int) -> list[Trial]:
    return make_trials(study, make_points(study), range(1, seeds + 1))


def lasting(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return rows without what differs between two runs of one trial."""
    return [{name: value for name, value in row.items() if name != "wall_s"} for row in rows]


# --- shards ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 3, 7, 100])
def test_shards_divide_the_trials_and_each_points_seeds_evenly(write: Callable[..., Study], count: int) -> None:
    trials = trials_of(write(GRID), 14)
    shards = [Shard(index, count).of(trials) for index in range(1, count + 1)]
    assert Counter(trial.key for shard in shards for trial in shard) == Counter(trial.key for trial in trials)
    assert max(map(len, shards)) - min(map(len, shards)) <= 1
    for fingerprint in {trial.point.fingerprint for trial in trials}:
        sizes = [sum(trial.point.fingerprint == fingerprint for trial in shard) for shard in shards]
        assert max(sizes) - min(sizes) <= 1


SLURM = {"SLURM_ARRAY_TASK_MIN": "0", "SLURM_ARRAY_TASK_MAX": "7", "SLURM_ARRAY_TASK_STEP": "1"}


@pytest.mark.parametrize(
    ("text", "environment", "shard"),
    [
        ("3/8", {}, (3, 8)),
        ("auto/8", {"JOB_COMPLETION_INDEX": "0"}, (1, 8)),
        ("auto/auto", SLURM | {"SLURM_ARRAY_TASK_ID": "7"}, (8, 8)),
        ("auto/8", SLURM | {"SLURM_ARRAY_TASK_ID": "2"}, (3, 8)),
        ("auto/auto", {"SLURM_ARRAY_TASK_ID": "4", "SLURM_ARRAY_TASK_MIN": "1", "SLURM_ARRAY_TASK_MAX": "4"}, (4, 4)),
        (
            "auto/auto",
            {
                "SLURM_ARRAY_TASK_ID": "9",
                "SLURM_ARRAY_TASK_MIN": "1",
                "SLURM_ARRAY_TASK_MAX": "17",
                "SLURM_ARRAY_TASK_STEP": "4",
            },
            (3, 5),
        ),
    ],
)
def test_a_shard_is_named_or_taken_from_the_scheduler(
    text: str, environment: dict[str, str], shard: tuple[int, int]
) -> None:
    found = parse_shard(text, environment)
    assert (found.index, found.count) == shard


@pytest.mark.parametrize(
    ("text", "environment", "line"),
    [
        ("0/3", {}, "--shard: expected I/N with 1 <= I <= N, auto/N, or auto/auto in a Slurm array, got 0/3"),
        ("4/3", {}, "--shard: expected I/N with 1 <= I <= N, auto/N, or auto/auto in a Slurm array, got 4/3"),
        ("three", {}, "--shard: expected I/N with 1 <= I <= N, auto/N, or auto/auto in a Slurm array, got 'three'"),
        (
            "auto/3",
            {},
            "--shard auto/3: auto needs SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX in the environment; neither is there",
        ),
        (
            "auto/auto",
            {"JOB_COMPLETION_INDEX": "1"},
            "--shard auto/auto: a Kubernetes job does not name the number of its pods; give it: auto/N",
        ),
        ("auto/2", {"JOB_COMPLETION_INDEX": "x"}, "--shard: expected whole numbers in the scheduler's variables"),
    ],
)
def test_a_shard_that_is_none_is_refused_in_one_line(text: str, environment: dict[str, str], line: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        parse_shard(text, environment)
    assert refused.value.mistakes == [line]


def test_merged_shards_have_the_rows_of_the_whole_study(write: Callable[..., Study], tmp_path: Path) -> None:
    study, whole = write(GRID), tmp_path / "whole.parquet"
    run_here(study, whole)
    shards = [Shard(index, 4) for index in (1, 2, 3, 4)]
    files = [shard.file(tmp_path / "parts.parquet") for shard in shards]
    assert [run_here(study, file, shard=shard).ran for shard, file in zip(shards, files, strict=True)] == [2, 2, 1, 1]
    merged = tmp_path / "merged.parquet"
    assert merge_files(files, merged) == 6
    assert run_here(study, merged).ran == 0
    assert lasting(read_rows(merged)) == lasting(read_rows(whole))
    # Merging again, also with the whole study, adds nothing.
    assert merge_files([*files, whole], merged) == 6


def test_the_rows_of_a_killed_shard_are_in_its_journal_and_it_resumes(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    study, first, second = write(GRID), tmp_path / "a-shard-1-of-2.parquet", tmp_path / "a-shard-2-of-2.parquet"
    run_here(study, first, shard=Shard(1, 2))
    run_here(study, second, shard=Shard(2, 2))
    kept, *_ = rows = read_rows(second)
    assert len(rows) == 3
    second.unlink()
    journal = second.with_name(second.name + ".journal")
    journal.write_bytes(msgspec.json.encode(kept) + b'\n{"study": "ti')
    assert merge_files([first, second], tmp_path / "part.parquet") == 4
    assert journal.exists()
    assert run_here(study, second, shard=Shard(2, 2)).ran == 2
    assert merge_files([first, second], tmp_path / "part.parquet") == 6


def test_two_results_of_one_trial_are_refused(write: Callable[..., Study], tmp_path: Path) -> None:
    from zwerm.study.rows import Rows

    study, one, other, out = write(TINY), tmp_path / "one.parquet", tmp_path / "other.parquet", tmp_path / "out.parquet"
    run_here(study, one)
    with Rows(other) as rows:
        for row in read_rows(one):
            rows.add(row | {"trace": "f" * 32} if row["seed"] == 2 else row)
        rows.merge(())
    with pytest.raises(
        ScenarioError, match=r"other.parquet: seed 2: expected the result that .*one.parquet has, got another"
    ):
        merge_files([one, other], out)
    with pytest.raises(ScenarioError, match=r"none.parquet: expected a file of a study's results; there is none"):
        merge_files([tmp_path / "none.parquet"], out)
    assert not out.exists()


def test_a_trial_that_failed_in_one_file_has_its_result_of_another(write: Callable[..., Study], tmp_path: Path) -> None:
    from zwerm.study.rows import Rows

    study, good, bad = write(TINY), tmp_path / "good.parquet", tmp_path / "bad.parquet"
    run_here(study, good)
    with Rows(bad) as rows:
        for row in read_rows(good):
            rows.add({name: row[name] for name in ("study", "variant", "seed", "fingerprint")} | {"outcome": "failed"})
        rows.merge(())
    for order in ([good, bad], [bad, good]):
        out = tmp_path / "out.parquet"
        merge_files(order, out)
        assert lasting(read_rows(out)) == lasting(read_rows(good))
        out.unlink()


# --- manifests and the command line ---------------------------------------------------------------------------------

MANIFESTS = ROOT / "deploy" / "manifests"


def test_the_manifests_run_their_shards_and_the_parts_are_merged(write: Callable[..., Study], tmp_path: Path) -> None:
    write(GRID)
    command = tmp_path / "bin" / "zwerm"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "from zwerm.cli.app import main; main()" "$@"\n')
    command.chmod(0o755)
    path = os.pathsep.join([str(command.parent), os.environ["PATH"]])

    def ran(*arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
        settings = os.environ | {"PYTHONPATH": str(ROOT), "PATH": path, "STUDY": "tiny.toml"} | environment
        return subprocess.run(arguments, cwd=tmp_path, env=settings, capture_output=True, text=True, check=False)

    array = {"SLURM_ARRAY_TASK_ID": "1", "SLURM_ARRAY_TASK_MIN": "1", "SLURM_ARRAY_TASK_MAX": "2"}
    slurm = ran("bash", str(MANIFESTS / "study.slurm"), **array)
    assert slurm.returncode == 0, slurm.stderr
    # Kubernetes replaces $(NAME) by the variables of the container.
    (container,) = yaml.safe_load((MANIFESTS / "study-job.yaml").read_text())["spec"]["template"]["spec"]["containers"]
    words = [word.replace("$(STUDY)", "tiny.toml").replace("$(SHARDS)", "2") for word in container["command"]]
    pod = ran(*words, JOB_COMPLETION_INDEX="1")
    assert pod.returncode == 0, pod.stderr
    merged = ran("zwerm", "merge", "runs/tiny-shard-1-of-2.parquet", "runs/tiny-shard-2-of-2.parquet")
    assert (merged.returncode, merged.stderr) == (0, "6 rows: runs/tiny.parquet\n")
    unclear = ran("zwerm", "merge", "runs/tiny.parquet")
    assert unclear.returncode == 2
    assert unclear.stderr == "zwerm: --out: give it: the files are not named as the shards of one study\n"


def test_the_job_of_kubernetes_is_valid_by_the_schema_of_its_api() -> None:
    kubernetes_validate = pytest.importorskip("kubernetes_validate", reason="`make dev` installs the schemas")
    job = yaml.safe_load((MANIFESTS / "study-job.yaml").read_text())
    kubernetes_validate.validate(job, kubernetes_validate.latest_version(), strict=True)
    spec = job["spec"]
    (container,) = spec["template"]["spec"]["containers"]
    shards = {each["name"]: each["value"] for each in container["env"]}["SHARDS"]
    assert int(shards) == spec["completions"]
    # The negative control: a misspelt key is refused.
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(
            job | {"spec": spec | {"complitions": 3}}, kubernetes_validate.latest_version(), strict=True
        )


# --- the order of trials --------------------------------------------------------------------------------------------


def test_a_long_trial_begins_early_enough_not_to_be_last_alone(write: Callable[..., Study]) -> None:
    trials = trials_of(write(GRID), 10)  # points of 1 and of 4 robots
    rows = [
        {"variant": "", "fingerprint": trial.point.fingerprint, "wall_s": 100.0 if index else 1.0}
        for index, trial in enumerate(trials[:2])
    ]
    ordered = in_order(trials, rows, 2)
    assert Counter(trial.key for trial in ordered) == Counter(trial.key for trial in trials)
    assert [trial.seed for trial in ordered[:8]] == [1, 1, 2, 2, 3, 3, 4, 4]
    # Two workers take 505 s. The last of ten long trials begins at 405 s at the latest, before short ones of lower seeds.
    long = [index for index, trial in enumerate(ordered) if trial.point.fingerprint == trials[1].point.fingerprint]
    assert long[-1] < len(ordered) - 1
    assert finish_s(ordered, trials, 2) <= finish_s(trials, trials, 2)
    assert finish_s(ordered, trials, 2) <= 510.0


def finish_s(ordered: list[Trial], trials: list[Trial], workers: int) -> float:
    """Return when the last of `workers` ends, where trials of the second point take 100 s and those of the first 1 s."""
    free = [0.0] * workers
    for trial in ordered:
        free.sort()
        free[0] += 100.0 if trial.point.fingerprint == trials[1].point.fingerprint else 1.0
    return max(free)


def test_without_rows_the_robots_and_ticks_decide_and_one_worker_keeps_the_order(write: Callable[..., Study]) -> None:
    trials = trials_of(write(GRID), 3)
    assert in_order(trials, [], 1) == trials
    assert in_order(trials, [], 2)[-1].point.settings == {"robots.count": 1}


# --- a cluster ------------------------------------------------------------------------------------------------------


@contextmanager
def dask_cluster(folder: Path) -> Iterator[tuple[str, list["subprocess.Popen[bytes]"]]]:
    """Start a Dask scheduler and two workers, processes of their own; yield the scheduler's address and the workers."""
    file = folder / "scheduler.json"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(folder)])}
    quiet: dict[str, Any] = {"cwd": folder, "env": environment, "stdout": subprocess.DEVNULL}

    def start(module: str, *arguments: str) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments]
        with (folder / f"{module}.log").open("ab") as log:
            return subprocess.Popen(command, **quiet, stderr=log)

    where = ("--host", "127.0.0.1", "--no-dashboard")
    processes = [start("dask_scheduler", *where, "--port", "0", "--scheduler-file", str(file))]
    try:
        until(lambda: file.exists() and file.read_text().endswith("}"), "the scheduler's file", DEADLINE_S)
        address = msgspec.json.decode(file.read_bytes())["address"]
        processes += [start("dask_worker", *where, "--no-nanny", "--nthreads", "1", address) for _ in range(2)]
        yield address, processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_cluster_loses_and_doubles_no_row_when_a_worker_is_killed(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    pytest.importorskip("distributed", reason="the cluster is Dask's, which `make dev` installs")
    study = write(TINY.replace("seeds = 3", "seeds = 12"), "Slow")
    ended: list[bool] = []

    with dask_cluster(tmp_path) as (address, workers):

        class KillsAWorker:
            def begin(self, total: int) -> None:
                assert total == 12

            def ended(self, failed: bool) -> None:
                ended.append(failed)
                if len(ended) == 3:
                    workers[0].kill()

        result = run_study(study, tmp_path / "out.parquet", cluster=address, listener=KillsAWorker())
        assert workers[0].poll() is not None
        assert workers[1].poll() is None
    assert (result.ran, result.done, result.failed, ended) == (12, 12, 0, [False] * 12)
    rows = read_rows(tmp_path / "out.parquet")
    assert sorted(row["seed"] for row in rows) == list(range(1, 13))
    assert len({key_of(row) for row in rows}) == 12
    # The rows are those of this machine.
    here = tmp_path / "here.parquet"
    run_here(study, here, seeds=[1, 2])
    assert lasting(read_rows(here)) == lasting(rows[:2])


def test_a_cluster_that_is_not_there_is_named_and_its_workers_take_no_jobs(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    pytest.importorskip("distributed", reason="the cluster is Dask's, which `make dev` installs")
    study = write(TINY)
    with pytest.raises(LinkError, match=r"--cluster nonsense://x: no Dask scheduler answers"):
        run_study(study, tmp_path / "out.parquet", cluster="nonsense://x")
    with pytest.raises(ScenarioError, match="cluster: expected neither jobs nor a timeout"):
        run_study(study, tmp_path / "out.parquet", cluster="tcp://127.0.0.1:1", jobs=2)
