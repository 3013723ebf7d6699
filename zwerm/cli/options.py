"""Arguments and options that several commands share, with their help texts."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final, Literal, Optional

import typer

from zwerm.catalogue import shipped
from zwerm.errors import ScenarioError

# A protocol, a host or an address, and a port; or a file of this machine. Settings of Zenoh may follow.
_ENDPOINT: Final = re.compile(
    r"(?:tcp|tls|quic)/(?:[^\s\[\]:#?]+|\[[0-9a-fA-F:.%]+\]):(?P<port>[0-9]{1,5})(?:[#?]\S*)?"
)
_LOCAL: Final = re.compile(r"unixsock-stream/\S+")
_PORT_MAX: Final = 65_535


def check_endpoint(option: str, endpoint: str) -> None:
    """Raise ScenarioError, in one line, if the value of an option is no Zenoh endpoint that robots can use."""
    network = _ENDPOINT.fullmatch(endpoint)
    if not (_LOCAL.fullmatch(endpoint) or (network and int(network["port"]) <= _PORT_MAX)):
        expected = "an endpoint such as tls/0.0.0.0:7447, with tls, quic or tcp"
        raise ScenarioError([f"{option}: expected {expected}, got {endpoint!r}"])


def built_in_names(*kinds: Literal["scenarios", "studies"]) -> Callable[[str], list[str]]:
    """Return the function by which the shell completes the names of built-in files, and of TOML files."""

    def complete(incomplete: str) -> list[str]:
        names = sorted(name for kind in kinds for name in shipped(kind))
        files = sorted(map(str, Path().glob("*.toml")))
        return [name for name in (*names, *files) if name.startswith(incomplete)]

    return complete


ScenarioName = Annotated[
    str,
    typer.Argument(
        help="A built-in scenario (see `zwerm list`) or a TOML file.", autocompletion=built_in_names("scenarios")
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="The seed of all random numbers of the run.")]
Sets = Annotated[
    Optional[list[str]],  # noqa: UP045 - typer reads it
    typer.Option("--set", metavar="PATH=VALUE", help="Override a setting of the scenario; may be given often."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress.")]
Picture = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--picture",
        metavar="FILE",
        help="The file of the picture: .png, .pdf or .svg; runs/SCENARIO-seedN.png by default. Settings are part of the name.",
    ),
]
PictureSize = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--size", metavar="WIDTHxHEIGHT", help="Greatest size of the arena in pictures [inches], such as 3.4x3."
    ),
]
Bare = Annotated[bool, typer.Option("--bare", help="Draw the arena only: no title, numbers, legend or curve.")]
ColourBy = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--colour-by", "--color-by", metavar="NAME", help="Colour robots by this telemetry."),
]
Links = Annotated[
    Optional[bool],  # noqa: UP045
    typer.Option("--links/--no-links", help="Connect robots whose packets have arrived."),
]
PictureAt = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--picture-at",
        metavar="CYCLE|TIMEs",
        help="Also draw this moment, a deployment cycle such as 40 or a time such as 120s; may be given often.",
    ),
]
Animation = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option("--animate", metavar="FILE", help="Also draw an animation: .gif, or .mp4 where ffmpeg is installed."),
]
Record = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--record",
        metavar="FILE.mcap",
        help="Record every message and the true state, for Foxglove and similar viewers.",
    ),
]
SecurityLogFile = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--security-log",
        metavar="FILE",
        help="Write each refusal by world and router to FILE: denials, wrong passwords, refused messages. Takes time.",
    ),
]
RobotUsers = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option(
        "--robot-users", metavar="FIRST", help="Run robot N as the user id FIRST + N, without a network. Needs root."
    ),
]
RobotMemory = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option("--robot-memory", min=1, metavar="MIB", help="Memory that each robot may allocate after it joins."),
]
RobotProcesses = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option(
        "--robot-processes", min=0, metavar="N", help="Processes that each robot may start. Needs --robot-users."
    ),
]
RealTime = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--realtime", metavar="FACTOR", help="Pace the run at FACTOR times the wall clock."),
]
HostNames = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option("--name", metavar="HOST", help="A name or address of the world's machine, for its certificate."),
]
OUTAGE_S: Final = 10.0
Outage = Annotated[
    float,
    typer.Option("--outage", min=1.0, metavar="S", help="A robot whose connection is silent for S seconds is lost."),
]
RadioTable = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option(
        "--radio-table",
        min=0,
        metavar="LINKS",
        help="Also print the radio's ledger: the LINKS links with most losses, and the nodes.",
    ),
]
