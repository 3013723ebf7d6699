"""Fidelity of the radio models: the mean over a million packets of each, and its 99 % confidence interval.

Prints one row for each number: model, quantity, expected value, measured value, half width of the interval, and whether the
measured value is inside. Deterministic models must be exact; shapely gives the expected values. With twenty numbers, one table
in five has a row outside by chance; a defect is outside for every seed.
"""

import argparse
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "helpers"))

from air import DT_S, Radio, ring

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.wire.messages import Transmission

Z99 = 2.576
Row = tuple[str, str, float, float, float]

NODES = 40
LINKS = NODES * (NODES - 1)


def unaudited_radio(
    models: list[dict[str, Any]], seed: int, positions: list[tuple[float, float]] | None = None
) -> Radio:
    """Return a radio without the audit of its ledger."""
    return Radio(positions or ring(NODES, 5.0), models, seed, check=False)


def row(model: str, what: str, expected: float, found: float, sd: float, count: float) -> Row:
    """Return a row for a mean of `count` independent values with deviation `sd`."""
    return model, what, expected, found, Z99 * sd / math.sqrt(count)


def fates(radio: Radio, ticks: int) -> np.ndarray:  # type: ignore[type-arg]
    """Return (links, ticks) whether each packet was lost; all nodes broadcast at every tick."""
    lost = np.ones((NODES, NODES, ticks), dtype=np.bool_)
    for tick in range(ticks):
        payload = tick.to_bytes(4, "big")
        radio.step({node: (Transmission("robots", payload),) for node in range(NODES)})
    radio.step({})
    for node, got in radio.received.items():
        sender = [packet.sender for _, packet in got]
        sent = [int.from_bytes(packet.payload, "big") for _, packet in got]
        lost[sender, node, sent] = False
    return lost[~np.eye(NODES, dtype=np.bool_)]


def burst_length(lost: np.ndarray) -> tuple[float, int]:  # type: ignore[type-arg]
    """Return the mean length of bursts and their number. A burst at the end of a row counts with its length so far."""
    before, after = lost[:, :-1], lost[:, 1:]
    ends = int((before & ~after).sum())
    return float(before.sum()) / ends, ends


def measure_places(packets: int, seed: int) -> Iterator[Row]:
    """Yield a row for each model that depends on positions only: random positions at each tick, two walls."""
    ticks = math.ceil(packets / LINKS)
    random = np.random.Generator(np.random.Philox(seed))
    walls = [[(50.0, 45.0), (50.0, 52.0)], [(47.0, 48.0), (55.0, 49.0)]]
    lines = shapely.linestrings(walls)
    models: dict[str, dict[str, Any]] = {
        "range": {"range_m": 4.0},
        "line_of_sight": {},
        "wall_attenuation": {"loss_db": 6.0, "margin_db": 10.0},
    }
    radios = {
        kind: Radio(ring(NODES, 5.0), [{"kind": kind, **table}], seed, walls, check=False)
        for kind, table in models.items()
    }
    expected = dict.fromkeys(models, 0)
    outboxes = {node: (Transmission("robots", b"beacon"),) for node in range(NODES)}
    for _ in range(ticks):
        places = random.uniform(45.0, 55.0, (NODES, 2))
        first, second = np.triu_indices(NODES, 1)
        between = shapely.linestrings(np.stack([places[first], places[second]], axis=1))
        crossed = sum(shapely.intersects(between, line).astype(int) for line in lines)
        near = shapely.dwithin(shapely.points(places[first]), shapely.points(places[second]), 4.0)
        for kind, passes in (("range", near), ("line_of_sight", crossed == 0), ("wall_attenuation", crossed < 2)):
            expected[kind] += 2 * int(passes.sum())
            radios[kind].position = places
            radios[kind].step(outboxes)
    for kind, radio in radios.items():
        radio.step({})
        yield kind, "packets delivered", expected[kind], radio.medium.summary()["delivered"], 0.0


def measure(packets: int, seed: int) -> Iterator[Row]:
    """Yield a row for each number."""
    yield from measure_places(packets, seed)
    ticks = math.ceil(packets / LINKS)
    sent = ticks * LINKS
    for fraction in (0.01, 0.3):
        found = unaudited_radio([{"kind": "loss", "fraction": fraction}], seed).all_broadcast(ticks)
        sd = math.sqrt(fraction * (1 - fraction))
        yield row("loss", "lost fraction", fraction, found["dropped"]["loss"] / sent, sd, sent)
    for loss, burst in ((0.1, 4.0), (0.5, 10.0)):
        lost = fates(
            unaudited_radio([{"kind": "gilbert_elliott", "loss_fraction": loss, "burst_packets": burst}], seed), ticks
        )
        r = 1 - 1 / burst - loss / (1 - loss) / burst
        yield row(
            "gilbert_elliott",
            "lost fraction",
            loss,
            lost.mean(),
            math.sqrt(loss * (1 - loss) * (1 + r) / (1 - r)),
            sent,
        )
        length, ends = burst_length(lost)
        yield row("gilbert_elliott", "burst length", burst, length, math.sqrt(burst * (burst - 1)), ends)
    deviations = {"uniform": 3**-0.5, "exponential": 1.0, "lognormal": math.sqrt(math.e - 1), "pareto": 0.8944}
    for distribution, sd in deviations.items():
        model = {"kind": "delay", "delay_s": 1.0, "jitter_s": 2.0, "distribution": distribution}
        yield row(
            "delay", f"mean, {distribution} [s]", 3.0, delay_s(unaudited_radio([model], seed), ticks), 2.0 * sd, sent
        )
    found = unaudited_radio([{"kind": "duplication", "fraction": 0.2}], seed).all_broadcast(ticks)
    yield row("duplication", "copied fraction", 0.2, found["copies"] / sent, 0.4, sent)
    rate = 0.001
    found = unaudited_radio([{"kind": "corruption", "bit_error_rate": rate}], seed).all_broadcast(ticks)
    chance = 1 - (1 - rate) ** 128
    yield row("corruption", "damaged fraction", chance, found["damaged"] / sent, math.sqrt(chance * (1 - chance)), sent)
    rate_model = {"kind": "rate_limit", "rate_bytes_s": 100.0, "queue_bytes": 64.0}
    radio = unaudited_radio([rate_model], seed)
    found = radio.all_broadcast(ticks)
    # Deterministic: the error is at most the bytes left in the queue at the end.
    expected = 100.0 * DT_S * ticks / 16.0
    yield "rate_limit", "transmissions a sender", expected, found["delivered"] / LINKS, 64.0 / 16.0
    airtime_s = 0.0005
    found = unaudited_radio([{"kind": "collision", "airtime_s": airtime_s}], seed).all_broadcast(ticks)
    a = airtime_s / DT_S
    chance = (1 - (2 * a - a * a)) ** (NODES - 1)
    # All packets of a transmission collide or none, and collisions come in pairs.
    count = ticks * NODES / 2
    got = found["delivered"] / sent
    yield row("collision", "delivered fraction", chance, got, math.sqrt(chance * (1 - chance)), count)
    half = NODES // 2
    places = [(10.0, 10.0)] * half + [(20.0, 10.0)] * half
    model = {"kind": "path_loss", "shadowing_sd_db": 0.0, "width_db": 2.0, "sensitivity_dbm": -72.2}
    lost = fates(unaudited_radio([model], seed, places), ticks)
    apart = np.array([(a < half) != (b < half) for a in range(NODES) for b in range(NODES) if a != b])
    chance = 1 / (1 + math.exp(-1))
    sd = math.sqrt(chance * (1 - chance))
    yield row("path_loss", "delivered at 10 m", chance, 1 - lost[apart].mean(), sd, lost[apart].size)


def delay_s(radio: Radio, ticks: int) -> float:
    """Return the mean delay [s]. Arrivals are read once a tick, half a tick late on average."""
    for tick in range(ticks):
        radio.step({node: (Transmission("robots", tick.to_bytes(4, "big")),) for node in range(NODES)})
    while radio.medium.summary()["in_flight"]:
        radio.step({})
    late = [
        arrived - int.from_bytes(packet.payload, "big") for got in radio.received.values() for arrived, packet in got
    ]
    return float(np.mean(late)) * DT_S - DT_S / 2


def is_inside(row: Row) -> bool:
    """Return whether the measured value is inside its interval."""
    _, _, expected, found, half = row
    return abs(found - expected) <= half


def main() -> None:
    """Print the table; exit with status 1 if more than one row is outside."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--packets", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    add_csv_option(parser)
    chosen = parser.parse_args()
    rows = []
    table = Table("model", "what", "expected", "found", "99 % within", "inside", box=None)
    outside = 0
    for each in measure(chosen.packets, chosen.seed):
        model, what, expected, found, half = each
        inside = is_inside(each)
        outside += not inside
        digits = ".5g" if half else "d"
        numbers = [f"{expected:{digits}}", f"{found:{digits}}", f"+-{half:.2g}" if half else "exact"]
        table.add_row(model, what, *numbers, "yes" if inside else "no")
        columns = ("model", "what", "expected", "found", "99 % within", "inside")
        cells = (f"`{model}`", what, *numbers, "yes" if inside else "no")
        rows.append({name: cell.replace("+-", "±") for name, cell in zip(columns, cells, strict=True)})
    Console().print(table)
    write_csv(chosen.csv, rows)
    sys.exit(outside > 1)


if __name__ == "__main__":
    main()
