"""Malformed input: wire messages, scenarios and maps that no correct program writes. Nothing may end in a traceback.

Wire messages are valid messages with bytes that are changed, cut off, inserted or appended, and messages of random bytes.
Each goes to every decoder that takes bytes from another process. A decoder returns a message, or raises one of the errors
that its callers count. Scenarios and maps are built-in ones with values, keys, lines or bytes that are changed; a mutant is
accepted, or refused with lines that name the place.
"""

import argparse
import random
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.errors import ProtocolError, ZwermError
from zwerm.run.assembly import prepare
from zwerm.scenario.load import load
from zwerm.wire.checksum import unseal
from zwerm.wire.messages import (
    REFUSABLE,
    BodyVelocity,
    Command,
    Failure,
    Goodbye,
    Hello,
    Observation,
    Packet,
    Transmission,
    Wake,
    Welcome,
    WheelSpeeds,
    decode_hello,
    decode_to_node,
    decode_welcome,
    encode,
    open_answer,
)

SCENARIOS: Final = Path(__file__).parents[2] / "scenarios"
BLOCK: Final = 100_000
LONGEST_S_MAX: Final = 10.0

DECODERS: Final[dict[str, Callable[[bytes], Any]]] = {
    "answer": open_answer,
    "to node": decode_to_node,
    "hello": decode_hello,
    "welcome": decode_welcome,
    "frame": unseal,
}

VALUES: Final = (
    *("0", "-1", "1e308", "1e999", "nan", "inf", "-0.0", "true", "99999999999999999999", "1979-05-27"),
    *('""', '"x"', '"../../../etc/passwd"', '"os:system"', '"' + "a" * 300 + '"', '"\\u0000"'),
    *("[]", "[[]]", "{}", "[1, 2, 3, 4]", "[" * 50 + "]" * 50),
)


def examples() -> list[bytes]:
    """Return valid messages of every kind."""
    return [
        encode(each)
        for each in (
            Command(drive=WheelSpeeds(0.1, -0.2), tick=7, telemetry={"a": 1.0}),
            Command(drive=BodyVelocity(0.1, 0.2, 0.3), wake=Wake(), outbox=(Transmission("robots", b"payload"),)),
            Failure(3, "ValueError: x", "Traceback"),
            Hello(4, 2, "zwerm 0.1.0"),
            Goodbye("the run is over"),
            Welcome(refused="joined"),
            Observation(5, 0.5, inbox=(Packet("robots", b"payload"),)),
        )
    ]


def mutants(seed: int, count: int) -> list[bytes]:
    """Return `count` malformed messages: random numbers for all of them are drawn at once."""
    draw = np.random.Generator(np.random.Philox(seed))
    valid = examples()
    which, kinds = draw.integers(len(valid), size=count), draw.integers(6, size=count)
    places, values, lengths = (
        draw.random((count, 3)),
        draw.integers(256, size=(count, 3)),
        draw.integers(64, size=count),
    )
    noise = draw.integers(256, size=BLOCK + 64, dtype=np.uint8).tobytes()
    found = []
    for example, kind, place, value, length, number in zip(
        which.tolist(), kinds.tolist(), places.tolist(), values.tolist(), lengths.tolist(), range(count), strict=True
    ):
        message = valid[example]
        at = int(place[0] * len(message))
        if kind == 0:
            found.append(message[:at])
        elif kind == 1:
            found.append(message[:at] + bytes([value[0]]) + message[at + 1 :])
        elif kind == 2:
            changed = bytearray(message)
            for each, new in zip(place, value, strict=True):
                changed[int(each * len(changed))] = new
            found.append(bytes(changed))
        elif kind == 3:
            found.append(message[:at] + noise[number : number + length] + message[at:])
        elif kind == 4:
            other = valid[value[0] % len(valid)]
            found.append(message[:at] + other[int(place[1] * len(other)) :])
        else:
            found.append(noise[number : number + length])
    return found


def decode_all(messages: Sequence[bytes], counts: dict[str, Counter[str]]) -> None:
    """Give each message to every decoder, and count its outcomes. Any other exception passes."""
    for name, decode in DECODERS.items():
        accepted = refused = 0
        for message in messages:
            try:
                decode(message)
                accepted += 1
            except (*REFUSABLE, ProtocolError):
                refused += 1
        counts[name].update(accepted=accepted, refused=refused)


def mutated(text: str, draw: random.Random) -> str:
    """Return a scenario's text with one to three mistakes."""
    lines = text.splitlines()
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        at = draw.randrange(len(lines))
        key, equals, _ = lines[at].partition("=")
        kind = draw.randrange(7)
        if kind <= 2 and equals:
            lines[at] = f"{key}= {draw.choice(VALUES)}"
        elif kind == 3 and equals:
            lines[at] = f"{key.strip()}x = 1"
        elif kind == 4:
            lines[at] = lines[at][: draw.randrange(len(lines[at]) + 1)]
        elif kind == 5:
            lines.insert(at, draw.choice(lines))
        else:
            lines[at] += draw.choice(
                ("\x00", "\ud800".encode("utf-8", "surrogatepass").decode("latin-1"), "]", '"', "\u202e")
            )
    return "\n".join(lines)


def try_scenario(path: Path) -> str:
    """Return the outcome of checking a scenario: accepted or refused. Any other exception passes."""
    try:
        prepare(load(str(path)))
    except ZwermError as error:
        return "refused" if str(error) else "refused without a word"
    return "accepted"


def mutated_bytes(content: bytes, draw: random.Random) -> bytes:
    """Return a map file with bytes that are changed, cut off or repeated."""
    changed = bytearray(content)
    kind = draw.randrange(4)
    if kind == 0:
        return bytes(changed[: draw.randrange(len(changed))])
    for _ in range(draw.choice((1, 3, 30))):
        # The header decides most, so half of the changes are there.
        at = draw.randrange(min(64, len(changed)) if draw.random() < 0.5 else len(changed))
        if kind == 1:
            changed[at] = draw.randrange(256)
        elif kind == 2:
            changed[at:at] = draw.randbytes(draw.randrange(8))
        else:
            changed[at : at + draw.randrange(8)] = b"9" * draw.randrange(8)
    return bytes(changed)


def main() -> None:
    """Try all, and print the counts. Exits with the traceback of the first input that is not handled, and names it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=2_000_000, help="each goes to all decoders")
    parser.add_argument("--scenarios", type=int, default=8_000)
    parser.add_argument("--maps", type=int, default=2_000)
    parser.add_argument("--seed", type=int, default=1)
    add_csv_option(parser)
    options = parser.parse_args()
    counts: dict[str, Counter[str]] = {name: Counter() for name in (*DECODERS, "scenarios", "maps")}
    for block in range(0, options.messages, BLOCK):
        decode_all(mutants(options.seed + block, min(BLOCK, options.messages - block)), counts)
    draw = random.Random(options.seed)
    texts = {path: path.read_text() for path in sorted(SCENARIOS.glob("*/*.toml"))}
    maps = {path: path.read_bytes() for path in sorted(SCENARIOS.glob("*/*.*")) if path.suffix not in (".toml", ".py")}
    with_maps = [path for path, text in texts.items() if any(each.name in text for each in maps)]
    longest_s, longest = 0.0, ""
    with TemporaryDirectory() as folder:
        copies = {path: Path(folder) / path.parent.name / path.name for path in (*texts, *maps)}
        for path, copy in copies.items():
            copy.parent.mkdir(exist_ok=True)
            copy.write_bytes(path.read_bytes())
        for number in range(options.scenarios + options.maps):
            kind = "scenarios" if number < options.scenarios else "maps"
            source = draw.choice(list(texts) if kind == "scenarios" else with_maps)
            trial = copies[source]
            trial.write_text(mutated(texts[source], draw) if kind == "scenarios" else texts[source], encoding="utf-8")
            changed = draw.choice([path for path in maps if path.name in texts[source]]) if kind == "maps" else None
            if changed is not None:
                copies[changed].write_bytes(mutated_bytes(maps[changed], draw))
            begin_s = time.monotonic()
            try:
                counts[kind][try_scenario(trial)] += 1
            except BaseException:
                print(f"{kind} {number} of seed {options.seed}, from {source.name}:\n{trial.read_text()}", flush=True)
                raise
            if time.monotonic() - begin_s > longest_s:
                longest_s, longest = time.monotonic() - begin_s, f"{kind} {number} of {source.name}"
            if changed is not None:
                copies[changed].write_bytes(maps[changed])
    rows = [
        {"input": f"{name} (decoder)" if name in DECODERS else name, "tried": str(each.total())}
        | {"accepted": str(each["accepted"]), "refused": str(each["refused"]), "tracebacks": "0"}
        for name, each in counts.items()
        if each.total()
    ]
    for row in rows:
        print(*row.values(), sep="\t", flush=True)
    print(f"longest: {longest}, {longest_s:.1f} s")
    write_csv(options.csv, rows)
    if longest_s > LONGEST_S_MAX:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
