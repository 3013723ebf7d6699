"""Safety of departures that robots negotiate with their neighbours, and comparison with relative H2.

Part 1: random swarms in a square, over a radio that loses, delays, reorders and duplicates packets. Robots crash,
restart without memory, are moved and return. A checker compares the Betti numbers of the complex before and after each
departure. The negative control has robots that leave without locks.

Part 2: the number of robots freed in the same swarms by relative H2 with global knowledge, and by negotiation of neighbours.
"""

import argparse
import time
from collections.abc import Iterator

import msgspec
import numpy as np

from benchmarks.algorithms.bench_homology import swarm
from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.agents.sensor_coverage.messages.locks import LockProtocolMessage
from zwerm.agents.sensor_coverage.protocols.component import Outgoing
from zwerm.agents.sensor_coverage.protocols.leave_lock import LeaveLock
from zwerm.maths.simplicial import FlagComplex, betti, find_redundant

TICK_S = 0.5
LEASE_S = 40.0
RANGE = 1.0


class Unlocked(LeaveLock):
    """Negative control: a robot that leaves without a lock."""

    def may_leave(self, now_s: float) -> bool:
        return self.wants and self._stands and self.redundant()


class RequestPacing:
    """Back-off between a robot's attempts to leave: the interval grows until the robot leaves."""

    def __init__(self, random: np.random.Generator) -> None:
        self.random = random
        self.wait_ticks = 20.0
        self.at = float(random.exponential(self.wait_ticks))

    def is_over(self, tick: int) -> bool:
        """Return whether the interval has passed; if so, start a longer one."""
        if tick < self.at:
            return False
        self.at = tick + 20.0 + float(self.random.exponential(self.wait_ticks))
        self.wait_ticks = min(2.0 * self.wait_ticks, 300.0)
        return True


class Radio:
    """Messages in flight. The receivers of a robot's messages are the robots that see it."""

    def __init__(self, random: np.random.Generator, loss: float, delay_ticks: int, copies: float) -> None:
        self.random = random
        self.loss, self.delay_ticks, self.copies = loss, delay_ticks, copies
        self.sent = self.bytes = 0
        self._due: dict[int, list[tuple[int, int, LockProtocolMessage]]] = {}

    def send(self, now: int, sender: int, around: list[int], outbox: list[Outgoing]) -> None:
        for to, message in outbox:
            self.sent += 1
            self.bytes += len(msgspec.msgpack.encode(message))
            for receiver in around if to is None else [to]:
                for _ in range(1 + (self.random.random() < self.copies)):
                    if self.random.random() >= self.loss:
                        at = now + 1 + int(self.random.integers(0, self.delay_ticks + 1))
                        self._due.setdefault(at, []).append((sender, receiver, message))

    def arrivals(self, now: int) -> list[tuple[int, int, LockProtocolMessage]]:
        return self._due.pop(now, [])


class Troubled:
    """A swarm with random events, and the checker of each departure."""

    def __init__(self, count: int, seed: int, loss: float, kind: type[LeaveLock] = LeaveLock) -> None:
        self.random = np.random.Generator(np.random.Philox(seed))
        self.radio = Radio(self.random, loss, delay_ticks=6, copies=0.1)
        self.kind = kind
        self.side = np.sqrt(count * np.pi / 8.0)  # eight neighbours on average
        self.place = self.random.uniform(0.0, self.side, (count, 2))
        self.robots = [kind(node, LEASE_S, -LEASE_S) for node in range(count)]
        self.standing = np.ones(count, dtype=bool)
        self.seen = np.ones(count, dtype=bool)
        self.down = np.zeros(count, dtype=bool)
        self.later: dict[int, list[tuple[str, int]]] = {}  # by tick: (event, node)
        self.tick = 0
        self.decisions = self.departures = self.violations = 0
        self._look()

    def run(self, decisions: int) -> None:
        """Run until `decisions` leave requests have ended, by a departure or not."""
        while self.decisions < decisions:
            self._happen()
            self._look()
            now_s = self.tick * TICK_S
            for node in np.flatnonzero(self.seen & ~self.down).tolist():
                self._see(node, now_s)
            for sender, receiver, message in self.radio.arrivals(self.tick):
                if not self.down[receiver] and self.seen[receiver]:
                    wanted = self.robots[receiver].wants
                    self._send(receiver, self.robots[receiver].receive(sender, message, now_s))
                    self.decisions += wanted and not self.robots[receiver].wants
            for node in np.flatnonzero(self.standing & ~self.down).tolist():
                self._act(node, now_s)
            self.tick += 1

    # --- one robot --------------------------------------------------------------------------------------------------

    def _see(self, node: int, now_s: float) -> None:
        robot = self.robots[node]
        before = robot.neighbour_list()
        robot.update(self.lists[node], now_s)
        if robot.neighbour_list() != before or (self.tick + node) % 10 == 0:
            self._send(node, [Outgoing(None, robot.neighbour_list())])

    def _act(self, node: int, now_s: float) -> None:
        robot = self.robots[node]
        if robot.may_leave(now_s):
            self._check(node)
            self._send(node, robot.leave(now_s))
            self.decisions += 1
            self.standing[node] = False
            self._plan(4, "vanish", node)
        elif robot.wants and (self.tick + node) % 3 == 0:
            self._send(node, robot.request(now_s))
            self.decisions += not robot.wants
        elif not robot.wants and self.random.random() < 0.02:
            self._send(node, robot.request(now_s))
        elif self.random.random() < 0.002 and not robot.locked(now_s):
            self.decisions += robot.wants
            self._send(node, robot.depart())
            self.standing[node] = False
            self._plan(10, "come", node)
        elif self.random.random() < 0.001:
            self.decisions += robot.wants
            self.down[node] = True
            self._plan(int(self.random.integers(1, 60)), "restart", node)

    def _check(self, node: int) -> None:
        """Compare b0 and b1 of the standing robots with and without this robot."""
        whole = FlagComplex({each: self.lists[each] for each in np.flatnonzero(self.standing).tolist()})
        self.departures += 1
        self.violations += betti(whole) != betti(whole.without([node]))

    # --- what happens -----------------------------------------------------------------------------------------------

    def _plan(self, ticks: int, what: str, node: int) -> None:
        self.later.setdefault(self.tick + ticks, []).append((what, node))

    def _happen(self) -> None:
        for what, node in self.later.pop(self.tick, []):
            match what:
                case "vanish":
                    self.seen[node] = False
                    self._plan(int(self.random.integers(1, 40)), "come", node)
                case "come":
                    self.place[node] = self.random.uniform(0.0, self.side, 2)
                    self.seen[node] = self.standing[node] = True
                    self.robots[node].settle()
                case "restart":
                    self.down[node] = False
                    self.robots[node] = self.kind(node, LEASE_S, self.tick * TICK_S)

    def _look(self) -> None:
        apart = np.hypot(*(self.place[:, None] - self.place[None, :]).transpose(2, 0, 1))
        near = (apart <= RANGE) & ~np.eye(len(apart), dtype=bool) & self.seen[:, None] & self.seen[None, :]
        self.lists = {node: np.flatnonzero(row).tolist() for node, row in enumerate(near)}

    def _send(self, node: int, outbox: list[Outgoing]) -> None:
        self.radio.send(self.tick, node, self.lists[node], outbox)


# --- beside relative H2 ---------------------------------------------------------------------------------------------


def freed_by_neighbours(
    lists: dict[int, list[int]], fenced: dict[int, None], seed: int, loss: float
) -> tuple[list[int], Radio, float]:
    """Negotiate until no robot can leave. Return the robots that left, the radio, and the time of the last departure [s]."""
    random = np.random.Generator(np.random.Philox(seed))
    radio = Radio(random, loss, delay_ticks=1, copies=0.0)
    robots = {node: LeaveLock(node, LEASE_S, -LEASE_S) for node in lists}
    pacing = {node: RequestPacing(random) for node in lists}
    left: list[int] = []
    tick = last = 0
    while tick - last < 1_500:
        now_s = tick * TICK_S
        for node, robot in robots.items():
            before = robot.neighbour_list()
            robot.update((other for other in lists[node] if other in robots), now_s)
            if robot.neighbour_list() != before or (tick + node) % 20 == 0:
                radio.send(
                    tick,
                    node,
                    [each for each in lists[node] if each in robots],
                    [Outgoing(None, robot.neighbour_list())],
                )
        for sender, receiver, message in radio.arrivals(tick):
            if receiver in robots:
                answers = robots[receiver].receive(sender, message, now_s)
                radio.send(tick, receiver, [each for each in lists[receiver] if each in robots], answers)
        for node in [each for each in robots if each not in fenced]:
            robot = robots[node]
            around = [each for each in lists[node] if each in robots]
            outbox = robot.leave(now_s)
            if outbox:
                left.append(node)
                last = tick
                del robots[node]
            elif (tick + node) % 3 == 0 if robot.wants else robot.redundant() and pacing[node].is_over(tick):
                outbox = robot.request(now_s)
            radio.send(tick, node, around, outbox)
        tick += 1
    return left, radio, last * TICK_S


def compare(cells: int, seeds: range) -> Iterator[tuple[str, float, float, float, float]]:
    """Yield (method, robots freed, messages a robot, bytes a robot, seconds), means over the seeds."""
    rows: dict[str, list[tuple[float, float, float, float]]] = {}
    for seed in seeds:
        lists, fence = swarm(cells, seed)
        complex_ = FlagComplex(lists)
        before = betti(complex_)
        start = time.process_time()
        redundant = find_redundant(complex_, fence).redundant
        spent_s = time.process_time() - start
        reported = sum(len(msgspec.msgpack.encode((each, *listed))) for each, listed in lists.items())
        rows.setdefault("relative H2", []).append((len(redundant), 1.0, reported / len(lists), spent_s))
        for loss in (0.0, 0.3, 0.5):
            left, radio, end_s = freed_by_neighbours(lists, {v: None for each in fence for v in each}, seed, loss)
            assert betti(complex_.without(left)) == before
            row = (len(left), radio.sent / len(lists), radio.bytes / len(lists), end_s)
            rows.setdefault(f"neighbours, loss {loss}", []).append(row)
    for name, each in rows.items():
        yield (name, *np.mean(each, axis=0).tolist())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--decisions", type=int, default=30_000, help="at each loss")
    parser.add_argument("--losses", type=float, nargs="+", default=[0.0, 0.1, 0.3, 0.5])
    parser.add_argument("--robots", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1, help="seed of the swarms of part 1")
    parser.add_argument("--seeds", type=int, default=5, help="number of swarms of part 2")
    parser.add_argument("--cost", action="store_true", help="run part 2 only")
    add_csv_option(parser)
    chosen = parser.parse_args()
    rows: list[dict[str, str]] = []
    print(f"{'loss':>6} {'decisions':>10} {'departures':>10} {'changed b0 or b1':>17} {'messages a decision':>20}")
    for kind in () if chosen.cost else (LeaveLock, Unlocked):
        for loss in chosen.losses:
            each = Troubled(chosen.robots, seed=chosen.seed, loss=loss, kind=kind)
            each.run(chosen.decisions if kind is LeaveLock else chosen.decisions // 10)
            departures_text = f"{loss:>6} {each.decisions:>10,} {each.departures:>10,} {each.violations:>17}"
            print(f"{departures_text} {each.radio.sent / each.decisions:>20.1f}  {kind.__name__}", flush=True)
            rows.append(
                {
                    "robots leave": "with locks" if kind is LeaveLock else "without locks (control)",
                    "loss": f"{loss:g}",
                    "decisions": f"{each.decisions}",
                    "departures": f"{each.departures}",
                    "changed b0 or b1": f"{each.violations}",
                }
            )
    beside = compared(range(chosen.seeds)) if chosen.seeds else []
    write_csv(chosen.csv, beside if chosen.cost else rows)


def compared(seeds: range) -> list[dict[str, str]]:
    """Print what leaving costs beside relative H2; return the rows, means over `seeds`."""
    rows = []
    print(f"\n{'robots':>6} {'':>22} {'freed':>7} {'messages a robot':>17} {'bytes a robot':>14} {'seconds':>9}")
    for cells in (6, 10, 14):
        for name, freed, messages, size, seconds in compare(cells, seeds):
            count = len(swarm(cells, 0)[0])
            print(f"{count:>6} {name:>22} {freed:>7.1f} {messages:>17.1f} {size:>14.0f} {seconds:>9.3f}", flush=True)
            rows.append(
                {
                    "robots": f"{count}",
                    "decided by": name,
                    "freed": f"{freed:.1f}",
                    "messages a robot": f"{messages:.1f}",
                    "bytes a robot": f"{size:.0f}",
                    "until the last has left [s]": f"{seconds:.3f}",
                }
            )
    return rows


if __name__ == "__main__":
    main()
