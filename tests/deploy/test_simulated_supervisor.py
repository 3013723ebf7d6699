"""The supervisor of robot processes under every mixture of failures, in virtual time. Seed N of a schedule is seed N here."""

import random

import pytest
from seeds import explored
from virtual_processes import NEVER, Fate, VirtualSystem

from zwerm.deploy.identity import issue, renew
from zwerm.deploy.supervisor import JOINING_MAX, LEAVE_WAIT_S, TERMINATE_WAIT_S, LocalSupervisor
from zwerm.errors import LinkError
from zwerm.link.session import Credential

SEEDS = explored(100)
DEADLINE_S = 60.0


class Drawn:
    """A swarm of 1 to 40 robots with fates that a seed draws, and its supervisor."""

    def __init__(self, seed: int, monkeypatch: pytest.MonkeyPatch, healthy: float) -> None:
        self.draw = random.Random(seed)
        self.credentials = issue("run", range(self.draw.randint(1, 40)))
        self.fates = {each.node: self._fate(healthy) for each in self.credentials.nodes}
        self.system = VirtualSystem(lambda credential: self.fates[credential.node], monkeypatch)
        order = self.draw.sample(sorted(self.fates), len(self.fates))
        self.supervisor = LocalSupervisor("unixsock-stream/none", self.credentials, order=order)
        self.supervisor._context = self.system  # type: ignore[assignment]

    def _fate(self, healthy: float) -> Fate:
        draw = self.draw
        joins_s = draw.uniform(0.1, 20.0)
        junk = draw.choice(
            (b"", b"", b"0", b"\xff\xff\xff\xff", bytes(5_000), self.credentials.nodes[0].password[:20].encode())
        )
        leaves_s = draw.choice((0.1, 1.0, NEVER))
        if draw.random() < healthy:
            return Fate(joins_s, junk=junk, leaves_s=leaves_s)
        kind = draw.choice(("late", "never", "ends", "ends after"))
        if kind == "late":
            return Fate(DEADLINE_S + draw.uniform(0.1, 20.0), junk=junk, leaves_s=leaves_s)
        if kind == "never":
            return Fate(junk=junk, leaves_s=leaves_s)
        if kind == "ends":
            return Fate(ends_s=draw.uniform(0.0, 30.0), exit_code=draw.randint(-15, 9), junk=junk)
        return Fate(joins_s, joins_s + draw.uniform(0.0, 5.0), junk=junk)

    def fails(self, node: int) -> bool:
        """Return whether a robot never joins in time."""
        return not self.fates[node].joins_s < min(self.fates[node].ends_s, DEADLINE_S)


def test_a_start_ends_with_all_joined_or_names_a_robot_that_did_not_join(monkeypatch: pytest.MonkeyPatch) -> None:
    outcomes = set()
    for seed in SEEDS:
        drawn = Drawn(seed, monkeypatch, healthy=0.97)
        system, reported = drawn.system, list[tuple[int, int]]()
        try:
            drawn.supervisor.start(lambda *each, reported=reported: reported.append(each), DEADLINE_S)
        except LinkError as error:
            said = str(error)
        else:
            said = ""
            assert not any(map(drawn.fails, drawn.fates)), seed
            assert reported == [(number, len(drawn.fates)) for number in range(1, len(drawn.fates) + 1)], seed
        if said:
            _, node, what, *_ = said.split()
            assert drawn.fails(int(node)), (seed, said)
        outcomes.add(what if said else "joined")
        assert system.starting_max <= JOINING_MAX, seed
        drawn.supervisor.stop()
        assert system.living() == [], seed
    assert outcomes == {"joined", "did", "ended"}, "the seeds reach every outcome"


def test_stopping_ends_every_robot_within_a_bound_and_kills_only_those_that_do_not_leave(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for seed in SEEDS:
        drawn = Drawn(seed, monkeypatch, healthy=1.0)
        drawn.supervisor.start(None, DEADLINE_S)
        begin_s = drawn.system.now
        drawn.supervisor.stop(LEAVE_WAIT_S)
        assert drawn.system.living() == [], seed
        # Each wait begins anew when a robot ends: the robots that leave do so after 0.1 s or 1 s.
        assert drawn.system.now - begin_s <= LEAVE_WAIT_S + 1.0 + TERMINATE_WAIT_S + 0.01, seed
        killed = {node for node, code in drawn.supervisor.exit_codes.items() if code == -9}
        assert killed == {node for node, fate in drawn.fates.items() if fate.leaves_s == NEVER}, seed


def test_an_interrupt_at_any_time_leaves_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted = 0
    for seed in SEEDS:
        drawn = Drawn(seed, monkeypatch, healthy=0.99)
        drawn.system.interrupt_at_s = drawn.draw.uniform(0.0, 30.0)
        try:
            with drawn.supervisor:
                drawn.supervisor.start(None, DEADLINE_S)
        except KeyboardInterrupt:
            interrupted += 1
        except LinkError:
            pass
        drawn.system.interrupt_at_s = NEVER
        assert drawn.system.living() == [], seed
    assert interrupted > len(SEEDS) // 4


def test_a_robot_that_is_killed_and_restarted_many_times_has_one_process_at_a_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for seed in explored(50):
        drawn = Drawn(seed, monkeypatch, healthy=1.0)
        current: dict[int, Credential] = {each.node: each for each in drawn.credentials.nodes}
        with drawn.supervisor as supervisor:
            supervisor.start(None, DEADLINE_S)
            for node in drawn.draw.choices(sorted(current), k=10):
                supervisor.kill(node)
                assert supervisor.exit_codes[node] == -9
                current[node] = renew(current[node])
                supervisor.restart(current[node], DEADLINE_S)
                assert sorted(each.node for each in drawn.system.living()) == sorted(current), seed
                assert node not in supervisor.exit_codes
        assert drawn.system.living() == [], seed
