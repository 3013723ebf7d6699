"""The base station without a centre: it lets robots out while the gradient leads to a frontier, and tells when none is left."""

from typing import Final

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.peers import (
    NOWHERE,
    Body,
    PushAborted,
    PushDone,
    PushToken,
    RedundantCall,
    RedundantOffer,
    RedundantPushEnd,
    StateBeacon,
    Word,
)
from zwerm.wire.messages import Command, Observation, Wake

# How long to wait for a robot to come out, for a push to end, and without a frontier before all is covered [ticks].
BIRTH_TICKS: Final = 60
PUSH_TICKS: Final = 2000
QUIET_TICKS: Final = 60
# How long to wait for a census that comes to a conclusion [ticks].
CENSUS_TICKS: Final = 6000
# How long after a push to wait for word of an edge before gaps are gone to [ticks].
GAP_TICKS: Final = 24
# How long to wait for who stands at the base, and is not ready [ticks].
STAY_TICKS: Final = 1500
# After so many pushes there is none for so long [ticks]: who can be spared comes to an agreement while all stand.
SPARE_EVERY: Final = 10
SPARE_TICKS: Final = 80


class LocalBase(LocalRobot):
    """A robot that never moves; its depot is its only actuator."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.vicinity.place = 0
        self.vicinity.heading = 0.0
        self.cycles = 0
        self.pushes = 0
        self.released = 0
        self.outcome = ""
        self._release = False
        self._released_at: int | None = None
        self._born = -1
        self._known: dict[int, None] = {}
        self._active: int | None = None
        self._first = False
        self._pushed = NOWHERE  # who was to take the rear of it
        self._since = self._edges_since = 0
        self._to_gap = False
        self._stays_since = 0
        self._quiet_since: int | None = None
        self._tokens = 0
        self._spares = setup.services.get("redundancy") in ("link", "coordinator")
        self._spared_at = 0
        self._spares_until: int | None = None
        self._offers: dict[int, tuple[int, ...]] = {}  # place of a spare robot: the way there, from it

    def step(self, observation: Observation) -> Command:
        """Hear, and decide whether another robot is wanted."""
        for each in observation.bearings or ():
            if each.node not in self._known:  # it came out just now
                self._known[each.node] = None
                self.released += 1
        command = super().step(observation)
        command.drive = None
        command.release, self._release = self._release, False
        command.done = self.outcome == "covered"
        command.gave_up = "" if self.outcome in ("", "covered") else self.outcome
        return command

    def _take_part(self) -> None:
        for to, body in self.post.lost:
            self.vicinity.forget(to)
            if isinstance(body, PushToken | RedundantCall) and body.push == self._active:
                self._end(False)
        self.post.sent.clear()
        self.post.lost.clear()
        self._decide()

    def _decide(self) -> None:
        """Start the next push, or wait for what there is to wait for."""
        if self.outcome:
            return
        if self._active is not None:
            self._stays_since = self.tick
            if self.tick - self._since > PUSH_TICKS:
                self._end(False)
            elif self._released_at is None and self._gone_out() and not self._offers:
                self._let_out()
            return
        alone = not any(s.place not in (0, NOWHERE) for s in self.vicinity.states.values())
        if not alone and not self.vicinity.leads:
            self._watch_quiet()
            return
        if not alone and self.vicinity.to_gap and self.tick - self._edges_since < GAP_TICKS:
            return  # word of an edge may be on its way
        self._quiet_since = None
        if self._waits_for_spares():
            return
        if not alone and self._offers:
            self._call()
            return
        waiting = [n for n, s in sorted(self.vicinity.states.items()) if s.waiting and n in self.senses.seen]
        if not waiting:
            if not self._someone_stays():
                self._let_out()
            return
        born = waiting[0]
        via = NOWHERE if alone else self.vicinity.onward()
        if via is None:
            return
        self._released_at = None
        self._tokens += 1
        self._to_gap = self.vicinity.to_gap
        self._active, self._since, self._first, self._pushed = self._tokens, self.tick, alone, born
        self.post.write(born, PushToken(self._active, self._active, (), via))

    def _waits_for_spares(self) -> bool:
        """Tell whether it is time for those who can be spared to leave the complex."""
        if not self._spares or self.pushes // SPARE_EVERY == self._spared_at // SPARE_EVERY:
            return False
        if self._spares_until is None:
            self._spares_until = self.tick + SPARE_TICKS
        if self.tick < self._spares_until:
            return True
        self._spared_at, self._spares_until = self.pushes, None
        return False

    def _call(self) -> None:
        """Have the next push come from a robot that has left the complex, rather than from the depot."""
        place = next(iter(self._offers))
        way = self._offers.pop(place)
        node = self.vicinity.at(way[-1])
        if node is not None and node in self.senses.seen:
            self._tokens += 1
            self._to_gap = self.vicinity.to_gap
            self._active, self._since, self._first, self._pushed = self._tokens, self.tick, False, NOWHERE
            self.post.write(node, RedundantCall(self._active, way))

    def _someone_stays(self) -> bool:
        """Tell whether somebody in sight has no place yet, and may be ready soon."""
        states = self.vicinity.states
        homeless = [node for node in self.bearings if node not in states or states[node].place == NOWHERE]
        if not homeless or self._released_at is not None:
            self._stays_since = self.tick
        return self.tick - self._stays_since < STAY_TICKS and bool(homeless) and self._released_at is None

    def _gone_out(self) -> bool:
        """Tell whether whom this push took from the base stands elsewhere: the next one has time to look around."""
        states = self.vicinity.states
        born = states.get(self._pushed)
        nobody = not any(states[node].place == NOWHERE for node in self.bearings if node in states)
        return not self._first and born is not None and born.place != NOWHERE and not born.moving and nobody

    def _let_out(self) -> None:
        if self._released_at is None:
            self._release = True
            self._released_at = self.tick
            self._born = self.released
        elif self.released == self._born and self.tick - self._released_at > BIRTH_TICKS:
            self.outcome = "depot-dry: the depot is empty"
            self._tell_numbers()

    def _watch_quiet(self) -> None:
        """Where no way leads to a frontier for a while, take the census; conclude from it, or from a very long silence."""
        if not self.clear or self.vicinity.route is not None:
            self._quiet_since = None
            return
        if self._quiet_since is None:
            self._quiet_since = self.tick
        last = self.ending.last
        if self._takes_census and self.ending.concluded:
            self.outcome = "covered"
        elif self.tick - self._quiet_since > CENSUS_TICKS:
            claimed = last is not None and last.claims > 0
            self.outcome = "cut-off: no way leads to the frontier" if claimed else "covered"
        if self.outcome:
            self._tell_numbers()

    @property
    def _takes_census(self) -> bool:
        waited = 0 if self._quiet_since is None else self.tick - self._quiet_since
        return waited > QUIET_TICKS + 4 * self._samples and not self.outcome

    @property
    def _occupied(self) -> bool:
        return super()._occupied or not self._takes_census

    def _tell_numbers(self) -> None:
        self._told |= {
            "deployment_cycles": self.cycles,
            "pushes": self.pushes,
            "robots_released": self.released,
        }

    def _end(self, tried: bool, done: bool = False) -> None:
        self._active = None
        if done or not self._to_gap:  # a gap that nobody came through makes no edges
            self._edges_since = self.tick
        self.cycles += tried or done
        self.pushes += done
        self._tell_numbers()
        if self._first and tried and not done:
            self.outcome = "source-blocked: no robot gets away from the base"

    def _read(self, sender: int, body: Body) -> None:
        if isinstance(body, PushToken):
            self.post.write(sender, PushAborted(body.push, False))
        elif isinstance(body, RedundantOffer):
            self._offers[body.places[0]] = body.places
        elif body.push == self._active:
            if isinstance(body, PushAborted):
                self._end(body.tried)
            elif isinstance(body, PushDone):
                self._end(True, True)
            elif isinstance(body, RedundantPushEnd):
                self._end(body.tried, body.done)

    def _hear(self, sender: int, word: Word) -> None:
        new = isinstance(word, StateBeacon) and sender not in self.vicinity.states
        super()._hear(sender, word)
        if new and isinstance(word, StateBeacon) and word.place == NOWHERE:
            self.speech.again(self.tick)  # it wants to know what the base sees

    def _wake(self) -> Wake | None:
        wake = super()._wake()
        if wake is None or self.outcome:
            return wake
        soon = self._active is None
        at_s = (self.tick + 1) * self.setup.dt_s if soon else wake.at_s
        return Wake(at_s=at_s, on_packet=True, on_visible=True)
