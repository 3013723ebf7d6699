"""A coordinator that does nothing but tell robots who of them can be spared: its part, the robots', and whole deployments."""

import math
import random
from collections.abc import Iterable

import numpy as np
import pytest

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.messages import advice as counsel
from zwerm.agents.sensor_coverage.messages.advice import (
    CollectReports,
    RedundantAdvice,
    ReportNoted,
    StandingReport,
    read,
    write,
)
from zwerm.agents.sensor_coverage.messages.peers import Word
from zwerm.agents.sensor_coverage.protocols.advice_client import (
    AGAIN_TICKS,
    BELIEVED_TICKS,
    SETTLED_TICKS,
    AdviceClient,
)
from zwerm.agents.sensor_coverage.protocols.leave_lock import LeaveLock, LockDenial, LockGrant, LockMessage
from zwerm.agents.sensor_coverage.protocols.leave_negotiation import LeaveNegotiation
from zwerm.coordinator.sensor_coverage.redundancy_advisor import AGAIN_TICKS as AGAIN_AT_CENTRE
from zwerm.coordinator.sensor_coverage.redundancy_advisor import ASK_TICKS, QUIET_TICKS, RedundancyAdvisor
from zwerm.maths.simplicial import FlagComplex, betti
from zwerm.run.runner import run
from zwerm.wire.messages import Observation, Packet

DT_S = 0.1
BASE = 1
Said = list[tuple[int | None, counsel.Word]]


def wheel(steps: tuple[int, ...] = (1, 2, 4, 5)) -> dict[int, StandingReport]:
    """A hub, and six around it that see those so many steps on, or all but the one opposite: all of these are at the fence."""
    around = {n: tuple(sorted(1 + (n - 1 + step) % 6 for step in steps)) for n in range(1, 7)}
    fenced = {n: tuple(sorted(1 + (n - 1 + d) % 6 for d in (1, 5))) for n in range(1, 7)}
    rim = {n: StandingReport(5, 10 + n, (0, *around[n]), fenced[n], True, False) for n in around}
    return {0: StandingReport(5, 10, tuple(around), (), True, True), **rim}


class Centre:
    """A coordinator, and what it says."""

    def __init__(self) -> None:
        self.sparing = RedundancyAdvisor(Setup(99, "coordinator", DT_S, (), b"0" * 32, bases=(BASE,)))
        self.tick = -1

    def hear(self, words: Iterable[tuple[int, counsel.Word]] = (), ticks: int = 1) -> Said:
        """Return what it says on hearing this, and in so many ticks from then on."""
        inbox = tuple(Packet(counsel.CHANNEL, write(word), sender) for sender, word in words)
        said: Said = []
        for number in range(ticks):
            self.tick += 1
            observation = Observation(self.tick, self.tick * DT_S, inbox=() if number else inbox)
            for each in self.sparing.step(observation).outbox:
                word = read(each.payload)
                assert word is not None
                said.append((each.to, word))
        return said


def spared(said: Said) -> dict[int | None, RedundantAdvice]:
    return {to: word for to, word in said if isinstance(word, RedundantAdvice)}


# --- words ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("word", [wheel()[1], ReportNoted(7), CollectReports(), RedundantAdvice(((1, 10), (2, 11)))])
def test_every_word_crosses_the_uplink_and_a_damaged_one_says_nothing(word: counsel.Word) -> None:
    payload = write(word)
    assert read(payload) == word
    for place in range(len(payload)):
        assert read(payload[:place] + bytes([payload[place] ^ 4]) + payload[place + 1 :]) is None
    assert read(payload[:-1]) is None


# --- the coordinator ------------------------------------------------------------------------------------------------


def test_the_hub_of_a_wheel_is_told_upon_which_lists_it_can_be_spared_and_nobody_else_is() -> None:
    centre = Centre()
    said = centre.hear(wheel().items())
    assert [to for to, word in said if isinstance(word, ReportNoted)] == list(range(7))
    assert not spared(said)
    assert spared(centre.hear(ticks=QUIET_TICKS)) == {0: RedundantAdvice(tuple((n, 10 + n) for n in range(1, 7)))}
    assert spared(centre.hear(ticks=AGAIN_AT_CENTRE)).keys() == {0}, "it may have got lost"


@pytest.mark.parametrize(
    ("node", "change"),
    [
        (0, {"willing": False}),
        (3, {"stands": False}),  # the hub still sees it
        (3, {"listed": (1, 2, 4, 5)}),  # one sees the other, and not the other way around
    ],
)
def test_nobody_is_told_to_leave_who_is_not_willing_or_whose_neighbours_are_not_those_it_sees(
    node: int, change: dict[str, object]
) -> None:
    centre, words = Centre(), wheel()
    fields = {name: getattr(words[node], name) for name in words[node].__struct_fields__}
    words[node] = StandingReport(**fields | change)  # type: ignore[arg-type]
    assert not spared(centre.hear(words.items(), ticks=1 + QUIET_TICKS))


def test_nobody_is_told_to_leave_whom_a_hole_would_follow() -> None:
    assert not spared(Centre().hear(wheel(steps=(1, 5)).items(), ticks=1 + QUIET_TICKS))


def test_of_two_that_can_be_spared_and_see_each_other_one_is_told() -> None:
    twins = {n: each for n, each in wheel().items() if n}
    twins = {
        n: StandingReport(5, each.version, (0, *each.listed[1:], 7), each.fenced, True, False)
        for n, each in twins.items()
    }
    twins[0] = StandingReport(5, 10, (1, 2, 3, 4, 5, 6, 7), (), True, True)
    twins[7] = StandingReport(5, 17, (0, 1, 2, 3, 4, 5, 6), (), True, True)
    assert len(spared(Centre().hear(twins.items(), ticks=1 + QUIET_TICKS))) == 1


def test_a_late_word_of_a_robot_undoes_none_that_is_newer() -> None:
    centre, words = Centre(), wheel()
    centre.hear(words.items())
    new = StandingReport(6, 20, words[0].listed, (), True, False)
    assert centre.hear([(0, new)]) == [(0, ReportNoted(6))]
    assert centre.hear([(0, words[0]), (0, words[0])]) == [], "what is old needs not be noted again"
    assert centre.hear([(0, new)]) == [(0, ReportNoted(6))], "that may have got lost"
    assert not spared(centre.hear(ticks=QUIET_TICKS))


def test_one_that_begins_anew_asks_all_and_then_those_that_others_see_and_it_has_not_heard() -> None:
    centre, words = Centre(), wheel()
    assert centre.hear() == [(None, CollectReports())]
    assert centre.hear(ticks=ASK_TICKS) == [(BASE, CollectReports())]
    centre.hear([(BASE, words[BASE])])
    asked = centre.hear(ticks=ASK_TICKS)
    assert {to for to, word in asked if isinstance(word, CollectReports)} == set(words[BASE].listed)
    assert spared(centre.hear(words.items(), ticks=1 + QUIET_TICKS)).keys() == {0}


# --- a robot --------------------------------------------------------------------------------------------------------


def told(robot: AdviceClient, tick: int, standing: StandingReport | None) -> list[counsel.Word | None]:
    robot.note(tick, standing)
    return [read(each) for each in robot.letters()]


def test_a_robot_says_how_it_stands_once_that_lasts_and_again_until_it_was_noted() -> None:
    robot, standing = AdviceClient(DT_S), StandingReport(0, 3, (1, 2), (), True, True)
    said = {tick: words for tick in range(100) if (words := told(robot, tick, standing))}
    assert list(said)[:3] == [SETTLED_TICKS, SETTLED_TICKS + AGAIN_TICKS, SETTLED_TICKS + 3 * AGAIN_TICKS]
    ((first,), *others) = said.values()
    assert isinstance(first, StandingReport)
    assert all(each == [first] for each in others)
    robot.hear(100, write(ReportNoted(first.number - 1)))
    assert robot.next_ticks()
    robot.hear(100, write(ReportNoted(first.number)))
    assert not robot.next_ticks()
    assert not told(robot, 400, standing)
    robot.hear(401, write(CollectReports()))
    assert told(robot, 401, standing) == [first], "a coordinator that begins anew asks"
    moved = StandingReport(0, 4, (1,), (), True, True)
    assert [told(robot, tick, moved) for tick in range(402, 402 + SETTLED_TICKS)] == [[]] * SETTLED_TICKS
    ((new,),) = (told(robot, 402 + SETTLED_TICKS, moved),)
    assert isinstance(new, StandingReport)
    assert new.number > first.number
    assert new.listed == (1,)


def test_a_robot_believes_a_verdict_for_a_while_and_while_it_sees_nobody_else() -> None:
    robot = AdviceClient(DT_S)
    assert robot.verdict(0, (1, 2)) is None
    robot.hear(0, write(RedundantAdvice(((1, 10), (2, 11)))))
    assert robot.verdict(BELIEVED_TICKS - 1, (1, 2)) == ((1, 10), (2, 11))
    assert robot.verdict(1, (1, 2, 3)) is robot.verdict(1, (1,)) is robot.verdict(BELIEVED_TICKS, (1, 2)) is None


def test_neighbours_grant_upon_a_verdict_only_if_it_names_their_lists_as_they_are() -> None:
    robots = {node: LeaveLock(node, 10.0, 0.0, 0.0) for node in (0, 1)}
    for node, robot in robots.items():
        robot.see([1 - node], 1.0)
    version = robots[1].tell().version
    assert robots[0].ask(1.0) == [], "it has heard of no list"
    assert robots[0].ask(1.0, ((2, version),)) == [], "it sees somebody else"
    for named, answer in ((version - 1, LockDenial), (version, LockGrant)):
        (asked,) = robots[0].ask(1.0, ((1, named),))
        (first, *_) = robots[1].hear(0, asked.message, 1.0)
        assert isinstance(first, LockMessage)
        assert isinstance(first.message, answer)
        robots[0].hear(1, first.message, 1.0)
    assert robots[0].may_leave(1.0)


# --- both, and an uplink on which nothing can be relied ---------------------------------------------------------------


class Swarm:
    """Robots about a grid, and a ring of others around them; who has left the complex is carried away after a while.

    What crosses the uplink is lost, late by up to `late` ticks, and repeated. With `locks` robots leave as they should, else
    as soon as they are told to.
    """

    def __init__(self, seed: int, late: int, locks: bool) -> None:
        self.luck = random.Random(seed)
        ring = [(0.9 * math.cos(n * math.tau / 10), 0.9 * math.sin(n * math.tau / 10)) for n in range(10)]
        grid = [0.35 * n - 0.525 for n in range(4)]
        inner = [(x + self.luck.uniform(-0.12, 0.12), y + self.luck.uniform(-0.12, 0.12)) for x in grid for y in grid]
        self.places = dict(enumerate([*ring, *inner]))
        self.rim = {n: ((n - 1) % 10, (n + 1) % 10) if n < 10 else () for n in self.places}
        self.centre = Centre()
        self.leaving = {
            n: LeaveNegotiation(n, DT_S, np.random.Generator(np.random.Philox(seed + n)), True) for n in self.places
        }
        self.counsel = {n: AdviceClient(DT_S) for n in self.places}
        self.gone_at: dict[int, int] = {}
        self.uplink: dict[int, list[tuple[int | None, int | None, bytes]]] = {}
        self.air: list[tuple[int, int, Word]] = []
        self.late, self.locks = late, locks
        self.left = self.changed = 0

    def sees(self, node: int, tick: int) -> tuple[int, ...]:
        here = self.places[node]
        bodies = [n for n in self.places if n != node and self.gone_at.get(n, tick) + 40 > tick]
        return tuple(n for n in bodies if math.dist(here, self.places[n]) < 0.75)

    def send(self, tick: int, sender: int | None, to: int | None, payload: bytes) -> None:
        for _ in range(self.luck.choice((0, 1, 1, 2))):
            at = tick + 1 + self.luck.randrange(1 + self.late)
            self.uplink.setdefault(at, []).append((sender, to, payload))

    def turn(self, tick: int) -> None:
        arrived = self.uplink.pop(tick, [])
        words = [(sender, read(payload)) for sender, _, payload in arrived if sender is not None]
        for to, word in self.centre.hear([(sender, word) for sender, word in words if word is not None]):
            for each in self.places if to is None else [to]:
                self.send(tick, None, each, write(word))
        heard, self.air = self.air, []
        for node, leaving in self.leaving.items():
            stands, advice = node not in self.gone_at, self.counsel[node]
            sight = self.sees(node, tick)
            leaving.watch(tick, sight)
            leaving.note(stands)
            for sender, to, payload in arrived:
                if sender is None and to == node:
                    advice.hear(tick, payload)
            for sender, receiver, word in heard:
                if receiver == node and self.luck.random() >= 0.2:
                    leaving.hear(sender, word)  # type: ignore[arg-type]
            verdict = advice.verdict(tick, sight)
            if leaving.turn(stands and verdict is not None, verdict) or (not self.locks and stands and verdict):
                self.leave(node, tick)
                leaving.note(stands=False)
            there = leaving.told
            assert there is not None
            standing = StandingReport(0, there.version, sight, self.rim[node], node not in self.gone_at, node >= 10)
            advice.note(tick, standing)
            for payload in advice.letters():
                self.send(tick, node, None, payload)
            for to, word in leaving.letters():
                self.air += [(node, each, word) for each in (sight if to is None else [to])]

    def leave(self, node: int, tick: int) -> None:
        there = {
            n: [m for m in self.sees(n, tick) if m not in self.gone_at] for n in self.places if n not in self.gone_at
        }
        whole = FlagComplex(there)
        self.changed += betti(whole) != betti(whole.without([node]))
        self.left += 1
        self.gone_at[node] = tick


def leave_as_told(late: int, locks: bool) -> tuple[int, int]:
    left = changed = 0
    for seed in range(4):
        swarm = Swarm(seed, late, locks)
        for tick in range(500):
            swarm.turn(tick)
        left, changed = left + swarm.left, changed + swarm.changed
    return left, changed


@pytest.mark.parametrize("late", [0, 80])
def test_who_leaves_upon_a_verdict_never_opens_a_hole_whatever_the_uplink_does(late: int) -> None:
    left, changed = leave_as_told(late, locks=True)
    assert left > 8
    assert changed == 0


def test_without_locks_late_verdicts_open_holes() -> None:
    assert leave_as_told(late=80, locks=False)[1] > 0


# --- whole deployments ------------------------------------------------------------------------------------------------

# Robots stand so near to each other that now and then one can be spared.
HALL = (
    *("arena.size_m=[2.2,1.8]", "base.pose=[0.2,0.9,0.0]", "robots.count=24"),
    *("robots.parameters.margin_m=0.45", "base.parameters.margin_m=0.45"),
    *("services.path=gradient", "services.redundancy=coordinator"),
)


def crash(for_s: float = math.inf) -> str:
    """Return the fault of a coordinator that dies, and comes back after so long or never."""
    back = f", for_s={for_s}" if for_s < math.inf else ""
    return f'faults=[{{kind="crash", at_s=50.0{back}, nodes=["coordinator"]}}]'


def test_robots_that_find_their_way_are_told_who_can_be_spared_the_same_in_processes() -> None:
    inline, processes = (
        run("sensor-coverage", seed=2, runner=each, overrides=HALL) for each in ("inline", "processes")
    )
    assert inline.trace == processes.trace
    assert inline.outcome == "completed"
    assert inline.metrics["coverage_fraction"] >= 0.98
    assert inline.metrics["removals"] >= 1.0
    assert inline.metrics["unsafe_removals"] == 0.0


def test_somebody_is_spared_and_no_hole_comes_open_while_a_third_of_all_words_is_lost() -> None:
    lossy = [*HALL, "radio.loss=0.3", "uplink.loss=0.3"]
    result = run("sensor-coverage", seed=1, runner="inline", overrides=lossy)
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.98
    assert result.metrics["removals"] >= 1.0
    assert result.metrics["unsafe_removals"] == result.metrics["concluded_early"] == 0.0


def test_a_deployment_whose_coordinator_dies_goes_on_without_it_and_spares_nobody_any_more() -> None:
    result = run("sensor-coverage", seed=2, runner="inline", overrides=[*HALL, crash()])
    assert result.crashed == [24]
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.98
    assert result.metrics["removals"] == 0.0


def test_a_coordinator_that_comes_back_with_nothing_in_mind_spares_again() -> None:
    result = run("sensor-coverage", seed=2, runner="inline", overrides=[*HALL, crash(for_s=3.0)])
    assert result.restarted == [24]
    assert result.outcome == "completed"
    assert result.metrics["removals"] >= 1.0
    assert result.metrics["unsafe_removals"] == 0.0
