"""How true the radio's models are: a million packets through each, against the 99 % confidence interval of what it promises.

Prints one row a number: model, what is measured, expected, found, the half width of the interval, and whether it is inside.
With twenty numbers one in five such tables has a row outside by chance; a defect shows in every seed.
"""

import argparse
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from air import DT_S, Radio, ring

from zwerm.protocol import Transmission

Z99 = 2.576
Row = tuple[str, str, float, float, float]

NODES = 40
LINKS = NODES * (NODES - 1)


def quiet(models: list[dict[str, Any]], seed: int, positions: list[tuple[float, float]] | None = None) -> Radio:
    """Return a radio that does not audit itself."""
    return Radio(positions or ring(NODES, 5.0), models, seed, check=False)


def row(model: str, what: str, expected: float, found: float, sd: float, count: float) -> Row:
    """Return a row for a mean of `count` independent values with deviation `sd`."""
    return model, what, expected, found, Z99 * sd / math.sqrt(count)


def fates(radio: Radio, ticks: int) -> np.ndarray:  # type: ignore[type-arg]
    """Return (links, ticks) which packets were lost while everyone broadcast at every tick."""
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


def burst_lengths(lost: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    """Return the lengths of the bursts that began in the first half of their row: hardly any is cut short."""
    ticks = lost.shape[1]
    padded = np.diff(np.pad(lost, ((0, 0), (1, 1))).astype(np.int8), axis=1).ravel()
    start, end = np.flatnonzero(padded == 1), np.flatnonzero(padded == -1)
    begun = start % (ticks + 1)
    return (end - start)[(begun > 0) & (begun < ticks // 2)]


def measure(packets: int, seed: int) -> Iterator[Row]:
    """Yield a row for every number."""
    ticks = math.ceil(packets / LINKS)
    sent = ticks * LINKS
    for fraction in (0.01, 0.3):
        found = quiet([{"kind": "loss", "fraction": fraction}], seed).all_broadcast(ticks)
        sd = math.sqrt(fraction * (1 - fraction))
        yield row("loss", "lost fraction", fraction, found["dropped"]["loss"] / sent, sd, sent)
    for loss, burst in ((0.1, 4.0), (0.5, 10.0)):
        lost = fates(quiet([{"kind": "bursts", "loss_fraction": loss, "burst_packets": burst}], seed), ticks)
        r = 1 - 1 / burst - loss / (1 - loss) / burst
        yield row("bursts", "lost fraction", loss, lost.mean(), math.sqrt(loss * (1 - loss) * (1 + r) / (1 - r)), sent)
        lengths = burst_lengths(lost)
        yield row("bursts", "burst length", burst, lengths.mean(), math.sqrt(burst * (burst - 1)), len(lengths))
    deviations = {"uniform": 3**-0.5, "exponential": 1.0, "lognormal": math.sqrt(math.e - 1), "pareto": 0.8944}
    for distribution, sd in deviations.items():
        model = {"kind": "delay", "delay_s": 1.0, "jitter_s": 2.0, "distribution": distribution}
        yield row("delay", f"mean, {distribution} [s]", 3.0, delay_s(quiet([model], seed), ticks), 2.0 * sd, sent)
    found = quiet([{"kind": "duplication", "fraction": 0.2}], seed).all_broadcast(ticks)
    yield row("duplication", "copied fraction", 0.2, found["copies"] / sent, 0.4, sent)
    rate = 0.001
    found = quiet([{"kind": "corruption", "bit_error_rate": rate}], seed).all_broadcast(ticks)
    chance = 1 - (1 - rate) ** 128
    yield row("corruption", "damaged fraction", chance, found["damaged"] / sent, math.sqrt(chance * (1 - chance)), sent)
    rate_model = {"kind": "rate_limit", "rate_bytes_s": 100.0, "queue_bytes": 64.0}
    radio = quiet([rate_model], seed)
    found = radio.all_broadcast(ticks)
    # Not random: what is left in the queue at the end is all that may be missing or too much.
    expected = 100.0 * DT_S * ticks / 16.0
    yield "rate_limit", "transmissions a sender", expected, found["delivered"] / LINKS, 64.0 / 16.0
    airtime_s = 0.0005
    found = quiet([{"kind": "collision", "airtime_s": airtime_s}], seed).all_broadcast(ticks)
    a = airtime_s / DT_S
    chance = (1 - (2 * a - a * a)) ** (NODES - 1)
    # The packets of a transmission share their fate, and collisions come in pairs.
    count = ticks * NODES / 2
    got = found["delivered"] / sent
    yield row("collision", "delivered fraction", chance, got, math.sqrt(chance * (1 - chance)), count)
    half = NODES // 2
    places = [(10.0, 10.0)] * half + [(20.0, 10.0)] * half
    model = {"kind": "path_loss", "shadowing_sd_db": 0.0, "width_db": 2.0, "sensitivity_dbm": -72.2}
    lost = fates(quiet([model], seed, places), ticks)
    apart = np.array([(a < half) != (b < half) for a in range(NODES) for b in range(NODES) if a != b])
    chance = 1 / (1 + math.exp(-1))
    sd = math.sqrt(chance * (1 - chance))
    yield row("path_loss", "delivered at 10 m", chance, 1 - lost[apart].mean(), sd, lost[apart].size)


def delay_s(radio: Radio, ticks: int) -> float:
    """Return the mean delay [s]; arrivals are looked at once a tick, half a tick late on average."""
    for tick in range(ticks):
        radio.step({node: (Transmission("robots", tick.to_bytes(4, "big")),) for node in range(NODES)})
    while radio.medium.summary()["in_flight"]:
        radio.step({})
    late = [
        arrived - int.from_bytes(packet.payload, "big") for got in radio.received.values() for arrived, packet in got
    ]
    return float(np.mean(late)) * DT_S - DT_S / 2


def main() -> None:
    """Print the table; exit with status 1 where more than one row is outside."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--packets", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    table = Table("model", "what", "expected", "found", "99 % within", "inside", box=None)
    outside = 0
    for model, what, expected, found, half in measure(chosen.packets, chosen.seed):
        inside = abs(found - expected) <= half
        outside += not inside
        numbers = [f"{expected:.5g}", f"{found:.5g}", f"+-{half:.2g}"]
        table.add_row(model, what, *numbers, "yes" if inside else "no")
    Console().print(table)
    sys.exit(outside > 1)


if __name__ == "__main__":
    main()
