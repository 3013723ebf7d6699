"""The built-in commands: output, exit status and error lines."""

import json
from pathlib import Path

import pytest
from command_line import zwerm

from zwerm import __version__
from zwerm.catalogue import ALGORITHMS, COMMANDS, plugins
from zwerm.cli.output_files import run_stem
from zwerm.scenario.load import built_in


def test_list_names_every_scenario() -> None:
    ran = zwerm("list")
    assert ran.returncode == 0
    for name in built_in():
        assert name in ran.stdout.split()


def test_list_groups_scenarios_and_studies_by_algorithm_and_filters_them() -> None:
    whole = json.loads(zwerm("list", "--json").stdout)["algorithms"]
    assert [row["name"] for row in whole] == [row.name for row in ALGORITHMS]
    assert {each["name"] for row in whole for each in row["entries"] if each["kind"] == "scenario"} == set(built_in())
    some = json.loads(zwerm("list", "gossip", "--json").stdout)["algorithms"]
    assert [each["name"] for row in some for each in row["entries"]] == ["gossip-max"]
    assert "nothing in the catalogue has this text" in zwerm("list", "no such thing").stdout


def test_list_names_the_plug_ins_of_every_kind() -> None:
    ran = zwerm("list", "--plugins")
    for kind, rows in plugins().items():
        assert f"{kind}: {', '.join(rows)}" in " ".join(ran.stdout.split())


def test_every_built_in_scenario_checks() -> None:
    ran = zwerm("check", *built_in())
    assert ran.returncode == 0, ran.stderr
    assert len(ran.stdout.splitlines()) == len(built_in())


def test_check_reports_every_error_of_every_stage_with_its_place_rule_and_value(tmp_path: Path) -> None:
    (tmp_path / "tables.toml").write_text(
        'arena = { size_m = [3.0, -1.0] }\nrobots = { count = 0, controller = "computation-free", colour = "red" }\n'
    )
    (tmp_path / "parts.toml").write_text(
        "arena = { size_m = [3.0, 3.0], polygon = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]] }\n"
        '[robots]\ncount = 2\ncontroller = "computation-free"\nparameters = { left_0 = 3.0 }\n'
    )
    ran = zwerm("check", "tables.toml", "parts.toml", cwd=tmp_path)
    assert ran.returncode == 2
    assert ran.stdout == ""
    printed = ran.stderr.splitlines()
    assert "zwerm: tables.toml: arena.size_m.1: expected > 0, got -1.0" in printed
    assert "zwerm: tables.toml: robots.count: expected >= 1, got 0" in printed
    assert any(line.startswith("zwerm: tables.toml: robots.colour: unknown key") for line in printed)
    assert any(line.startswith("zwerm: parts.toml: arena: expected exactly one of") for line in printed)
    assert (
        "zwerm: parts.toml: robots.sensors: the controller computation-free needs the sensor 'line_of_sight'" in printed
    )
    assert "zwerm: parts.toml: robots.parameters.left_0: expected <= 1.0, got 3.0" in printed


def test_check_reports_an_unknown_controller_and_an_unknown_sensor_beside_errors_in_the_tables(tmp_path: Path) -> None:
    (tmp_path / "all.toml").write_text(
        'arena = { size_m = [3.0, 3.0] }\ntime = { dt_s = 0.0 }\n[robots]\ncount = 2\ncontroller = "nobody"\ncuont = 3\n'
        'sensors = [{ kind = "sonar" }]\nplacement = { kind = "uniform", colour = 1 }\n'
    )
    printed = zwerm("check", "all.toml", cwd=tmp_path).stderr.splitlines()
    assert [line.split(": ")[2] for line in printed] == [
        "time.dt_s", "robots.placement.colour", "robots.cuont", "robots.controller", "robots.sensors.0.kind",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["run", "no-such"], "zwerm: no-such: expected a scenario file or the name of a built-in one; nearest are "),
        (["run", "computation-free", "--set", "robots.count=none"], "zwerm: --set robots.count=none: robots.count: "),
        (["run", "computation-free", "--set", "robots.cuont=4"], "robots.cuont: unknown key; did you mean count?"),
        (["run", "computation-free-comparison"], "run it with: zwerm study computation-free-comparison"),
        (["study", "computation-free"], "run it with: zwerm run computation-free"),
        (["run", "computation-free", "--set", "robots.controller=zoo:Robot:x"], "cannot import 'zoo': "),
        (["run", "computation-free", "--set", "robots"], "zwerm: --set robots: expected path=value"),
        (
            ["run", "computation-free", "--set", "robots.controller=nobody"],
            "robots.controller: expected a built-in controller",
        ),
        (["run", "computation-free", "--set", "robots.controller=no_such_file:Robot"], "cannot import 'no_such_file'"),
        (["run", "computation-free", "--set", "robots.count=2000"], "robots.placement: no room for robot"),
        (
            ["world", "computation-free", "--listen", "foo", "--credentials", "k"],
            "zwerm: --listen: expected an endpoint such as tls/0.0.0.0:7447, with tls, quic or tcp, got 'foo'",
        ),
        (["world", "computation-free", "--listen", "foo/bar", "--credentials", "k"], "tls, quic or tcp, got 'foo/bar'"),
        (["world", "computation-free", "--listen", "tcp/127.0.0.1", "--credentials", "k"], "got 'tcp/127.0.0.1'"),
        (["world", "computation-free", "--listen", "tcp/[::1:7447", "--credentials", "k"], "got 'tcp/[::1:7447'"),
        (["robot", "--connect", "tcp/127.0.0.1:99999", "--credentials", "k"], "zwerm: --connect: expected an endpoint"),
        (
            ["compare", "gossip-max", "--variant", "a", "--variant", "b", "--figure", "figure.jpeg"],
            "zwerm: --figure: figure.jpeg: expected a file that ends in .png or .pdf or .svg",
        ),
        (
            ["compare", "gossip-max", "--variant", "a", "--variant", "b", "--metrics", "tikcs"],
            "got 'tikcs'; did you mean ticks?",
        ),
        (
            ["run", "computation-free", "--inline", "--realtime", "0"],
            "zwerm: realtime: expected a factor of at least 1e-06, got 0.0",
        ),
        (
            ["robot", "--connect", "tcp/127.0.0.1:1", "--credentials", "none.key"],
            "zwerm: none.key: cannot read credentials",
        ),
    ],
)
def test_an_input_error_is_one_line_and_status_2(arguments: list[str], line: str) -> None:
    ran = zwerm(*arguments)
    assert ran.returncode == 2, ran.stderr
    assert line in ran.stderr
    assert "Traceback" not in ran.stderr
    assert ran.stdout == ""


def test_json_prints_one_object_with_exactly_the_documented_keys(tmp_path: Path) -> None:
    ran = zwerm(
        "run", "computation-free", "--inline", "--json", "--seed", "2", "--set", "time.duration_s=1", cwd=tmp_path
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr == ""
    found = json.loads(ran.stdout)
    assert list(found) == [
        "scenario", "seed", "runner", "outcome", "trace", "ticks", "sim_s", "wall_s", "robots", "robot_ticks", "metrics",
        "radio", "middleware_lost", "nodes", "faults", "refused",
    ]  # fmt: skip
    assert (found["scenario"], found["seed"], found["runner"]) == ("computation-free", 2, "inline")
    assert (found["outcome"], found["ticks"], found["sim_s"], found["robot_ticks"]) == ("time-limit", 10, 1.0, 250)
    assert found["radio"] == {
        "sent": 0, "delivered": 0, "dropped": {}, "in_flight": 0, "out_of_reach": 0,
        "bytes": 0, "copies": 0, "damaged": 0, "channels": {},
    }  # fmt: skip
    nobody: dict[str, list[int]] = {each: [] for each in ("crashed", "restarted", "paused", "slow", "late")}
    assert found["nodes"] == nobody | {"reasons": {}}
    assert found["faults"] == []
    assert {"cell_coverage_fraction", "area_coverage_fraction"} <= set(found["metrics"])
    assert list(tmp_path.iterdir()) == []


def test_run_without_json_prints_the_outcome_and_the_paths_of_the_pictures(tmp_path: Path) -> None:
    ran = zwerm(
        "run", "computation-free", "--inline", "--set", "time.duration_s=2", "--animate", "run.gif", cwd=tmp_path
    )
    assert ran.returncode == 0, ran.stderr
    for word in (
        "time-limit",
        "cell_coverage_fraction",
        "robot-ticks/s",
        "trace",
        "runs/computation-free-seed1-time.duration_s=2.png",
        "run.gif",
    ):
        assert word in ran.stdout
    assert (tmp_path / "runs/computation-free-seed1-time.duration_s=2.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "run.gif").read_bytes().startswith(b"GIF89a")


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_every_command_has_an_example(command: str) -> None:
    assert f"zwerm {command}" in zwerm(command, "--help").stdout.partition("Example")[2]


def test_h_prints_the_same_help_as_the_long_option() -> None:
    assert zwerm("-h").stdout == zwerm("--help").stdout
    assert zwerm("run", "-h").stdout == zwerm("run", "--help").stdout


def test_a_misspelt_command_is_answered_with_the_nearest_name_and_status_2() -> None:
    ran = zwerm("rnu")
    assert ran.returncode == 2
    assert "Did you mean 'run'" in ran.stderr


def test_version_prints_the_version() -> None:
    assert zwerm("--version").stdout == f"zwerm {__version__}\n"


def test_picture_at_draws_each_moment_and_an_unknown_cycle_keeps_the_result(tmp_path: Path) -> None:
    hall = ["--set", "arena.size_m=[1.2,1.0]", "--set", "base.pose=[0.2,0.5,0.0]", "--set", "robots.count=8"]
    moments = ["--picture-at", "2", "--picture-at", "1.5s", "--picture-at", "999"]
    ran = zwerm("run", "sensor-coverage", "--inline", *hall, *moments, cwd=tmp_path)
    assert ran.returncode == 2
    assert "zwerm: cycle 999: expected one that the run reported, which are " in ran.stderr
    assert "trace" in ran.stdout
    drawn = sorted(path.name for path in (tmp_path / "runs").iterdir())
    stem = run_stem("sensor-coverage", 1, hall[1::2])
    assert drawn == [f"{stem}{each}.png" for each in ("-1.5s", "-cycle2", "")]
    wrong = zwerm("run", "sensor-coverage", "--picture-at", "soon", cwd=tmp_path)
    assert wrong.returncode == 2
    assert wrong.stderr == "zwerm: --picture-at: expected a cycle such as 40 or a time such as 120s, got 'soon'\n"
