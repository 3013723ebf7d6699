"""A leader by leases (Gray, Cheriton 1989): a robot leads while a majority has promised to support no other one.

A candidate asks all robots, and stamps the request with its own clock. A robot without a promise in force promises its support
for `lease_s` and answers with the candidate's stamp. With answers from a majority, itself included, the candidate leads until
`lease_s - margin_s` after its stamp, by its own clock. It renews the lease while it leads.

Each robot measures the end of a lease or promise with its own clock, from a time of its own. So offsets of clocks have no
effect, and drift has none while both clocks together gain less than `margin_s` in a lease. With `absolute` a promise ends
when the robot's clock reads the candidate's stamp plus `lease_s`. That is wrong if clocks have offsets: there can be two
leaders at a time.
"""

from struct import Struct as Layout
from struct import error as LayoutError
from typing import Annotated, Any, ClassVar, Final, NamedTuple

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ProtocolError
from zwerm.wire.checksum import seal, unseal
from zwerm.wire.messages import Command, Observation, Transmission

_LAYOUT: Final = Layout(">BHHd")
_REQUEST: Final = 1
_PROMISE: Final = 2
_NEVER_S: Final = float("-inf")


class LeaseTable(Struct, frozen=True, forbid_unknown_fields=True):
    """`swarm` robots take part. A candidate waits up to `backoff_s` before it asks, and renews after `renew_s`.

    A leader leads for `margin_s` less than its lease. With `absolute` promises end at a time of the candidate's clock.
    """

    swarm: Annotated[int, Meta(ge=1)]
    lease_s: Annotated[float, Meta(gt=0.0)] = 2.0
    margin_s: Annotated[float, Meta(ge=0.0)] = 0.1
    renew_s: Annotated[float, Meta(gt=0.0)] = 0.5
    backoff_s: Annotated[float, Meta(gt=0.0)] = 1.0
    absolute: bool = False


class _LeaseMessage(NamedTuple):
    """A request or a promise: `candidate` is the robot to support, `stamp_s` the time of the request by the candidate's
    clock."""

    kind: int
    sender: int
    candidate: int
    stamp_s: float


class LeaderLease(Controller):
    """Requests a lease if it has promised support to no robot, and leads while it holds one."""

    Parameters: ClassVar[type[Struct]] = LeaseTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.refused = 0
        self._promised_to = setup.node
        self._promised_until_s = _NEVER_S
        self._leads_until_s = _NEVER_S
        self._stamp_s = _NEVER_S  # of the newest request of its own
        self._supporters: dict[int, None] = {}
        self._ask_at_s: float | None = None

    def step(self, observation: Observation) -> Command:
        """Receive requests and promises, and send a request if it is due."""
        now_s = observation.time_s  # by this robot's clock
        answers = []
        for packet in observation.inbox:
            message = self._decoded(packet.payload)
            if message is None:
                continue
            if message.kind == _REQUEST and self._promise(message, now_s):
                answers.append(_LeaseMessage(_PROMISE, self.setup.node, message.candidate, message.stamp_s))
            elif message.kind == _PROMISE:
                self._count(message)
        if self._is_time(now_s):
            self._stamp_s = now_s
            self._supporters = {}
            request = _LeaseMessage(_REQUEST, self.setup.node, self.setup.node, now_s)
            if self._promise(request, now_s):
                answers.append(request)
                self._count(_LeaseMessage(_PROMISE, self.setup.node, self.setup.node, now_s))
        sent = [Transmission(channel, seal(_LAYOUT.pack(*each))) for channel in self.setup.channels for each in answers]
        return Command(outbox=tuple(sent), telemetry={"leader": now_s < self._leads_until_s})

    def _decoded(self, payload: bytes) -> _LeaseMessage | None:
        """Return the message in a packet, or None if there is none."""
        try:
            return _LeaseMessage(*_LAYOUT.unpack(unseal(payload)))
        except (ProtocolError, LayoutError):
            self.refused += 1
            return None

    def _promise(self, request: _LeaseMessage, now_s: float) -> bool:
        """Promise support to a candidate, unless another promise is in force; return whether it was promised."""
        if now_s < self._promised_until_s and self._promised_to != request.candidate:
            if not self._yields_to(request.candidate, now_s):
                return False
            self._stamp_s, self._supporters = _NEVER_S, {}  # later answers to its own request do not count
        table: Any = self.parameters
        self._promised_to = request.candidate
        self._promised_until_s = (request.stamp_s if table.absolute else now_s) + table.lease_s
        self._ask_at_s = None
        return True

    def _yields_to(self, candidate: int, now_s: float) -> bool:
        """Return whether this robot is a candidate without a lease and yields to another one: the smaller id has priority.

        Without a rule all robots could be candidates that support themselves, for ever.
        """
        return self._promised_to == self.setup.node and now_s >= self._leads_until_s and candidate < self.setup.node

    def _count(self, promise: _LeaseMessage) -> None:
        """Begin to lead if this promise makes a majority."""
        if promise.candidate != self.setup.node or promise.stamp_s != self._stamp_s:
            return
        self._supporters[promise.sender] = None
        table: Any = self.parameters
        if 2 * len(self._supporters) > table.swarm:
            self._leads_until_s = max(self._leads_until_s, self._stamp_s + table.lease_s - table.margin_s)

    def _is_time(self, now_s: float) -> bool:
        """Return whether to send a request now: a leader renews; others wait until their promise has ended and then a
        random time."""
        table: Any = self.parameters
        if now_s < self._leads_until_s:
            return bool(now_s >= self._stamp_s + table.renew_s)
        if now_s < self._promised_until_s and self._promised_to != self.setup.node:
            return False
        if self._ask_at_s is None:
            self._ask_at_s = now_s + float(self.random.uniform(0.0, table.backoff_s))
        if now_s < self._ask_at_s:
            return False
        self._ask_at_s = now_s + float(self.random.uniform(0.0, table.backoff_s))
        return True
