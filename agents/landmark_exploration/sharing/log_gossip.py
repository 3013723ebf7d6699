"""Gossip: robots in radio range make their logs and registers equal, although messages may be lost, late or repeated.

A robot broadcasts new entries once, in the tick in which it gets them. Beacons carry a digest of the version vector. A
robot that receives another digest sends its vector, and the other robot answers with the missing entries (anti-entropy;
Demers et al. 1987). Each message can be read without the others, and no robot waits for one: a lost
message costs time only. A hub, the coordinator in the middle of a star, also forwards the messages that it receives.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from zwerm.agents.landmark_exploration.sharing.landmark_messages import (
    LARGE_BYTES,
    Entries,
    Message,
    Register,
    RegisterBeacon,
    Vector,
)
from zwerm.agents.landmark_exploration.sharing.packing import counts_of, pack_entries, pack_vector, register_bytes
from zwerm.agents.landmark_exploration.sharing.registers import Registers
from zwerm.agents.landmark_exploration.sharing.replica import Replica, Stretch

# Ticks between a robot's beacons, and between the vectors it sends.
BEACON_TICKS: Final = 8
SYNC_TICKS: Final = 4
# Ticks for which a beacon with another digest counts.
DIFFERS_TICKS: Final = 12
# Entries in answer to one vector, at most.
ANSWER_ENTRIES_MAX: Final = 150
SMALL_ANSWER_ENTRIES_MAX: Final = 40
# Bytes of a beacon beside its registers, and bytes of a register with small identifiers.
_BEACON_BYTES: Final = 4 + 1 + 2 + 9 + 1
_REGISTER_BYTES: Final = 22
_REGISTERS_MAX: Final = 16


class AddressedMessage(NamedTuple):
    """A message to one node, or to all in reach where `to` is None."""

    to: int | None
    message: Message


class Gossip:
    """One node's part. `learn` is called with every stretch of new entries, and the number of entries held before.

    `me` is the node itself, which has a register; a hub has none. Pass every message that arrives to `receive`. `tick` then
    returns the messages to send.
    """

    def __init__(
        self,
        me: int,
        replica: Replica,
        registers: Registers,
        learn: Callable[[Stretch, int], None],
        bytes_max: int = LARGE_BYTES,
        hub: bool = False,
    ) -> None:
        self._me = me
        self._replica = replica
        self._registers = registers
        self._learn = learn
        self._bytes_max = bytes_max
        self._hub = hub
        self._answer_max = ANSWER_ENTRIES_MAX if bytes_max >= LARGE_BYTES else SMALL_ANSWER_ENTRIES_MAX
        self._differs: dict[int, int] = {}  # node: the tick of its last beacon with another digest
        self._synced: dict[int, int] = {}  # node: the tick at which it was last sent the vector
        self._beacon_at = me % BEACON_TICKS
        self._sync_at = 0
        self._outgoing: list[AddressedMessage] = []
        self._fresh: list[Stretch] = []

    def announce(self, stretch: Stretch) -> None:
        """Broadcast new entries of this node's own log."""
        self._fresh.append(stretch)

    def beacon_soon(self) -> None:
        """Send a beacon with the next tick, because this node's register has changed."""
        self._beacon_at = 0

    def receive(self, sender: int, message: Message, tick: int) -> None:
        """Process a message."""
        match message:
            case Entries():
                stretch = Stretch(message.origin, message.first, message.entries)
                held = self._replica.vector.get(stretch.origin, 0)
                new = self._replica.extend(stretch)
                if new:
                    learnt = Stretch(stretch.origin, held, tuple(new))
                    self._learn(learnt, held)
                    if self._hub:
                        self._fresh.append(learnt)
                elif stretch.first > held:
                    self._differs[sender] = tick
            case Vector():
                self._answer(sender, message, tick)
            case RegisterBeacon():
                news = self._registers.merge_all(message.registers, self._me, tick)
                if self._hub and news:
                    self._beacon_at = min(self._beacon_at, tick + 1)
                if message.digest != self._replica.digest:
                    self._differs[sender] = tick
                else:
                    self._differs.pop(sender, None)
            case _:
                pass

    def tick(self, tick: int, own: Callable[[], Register] | None) -> list[AddressedMessage]:
        """Return what to send now; `own` makes the node's own register, with a new stamp."""
        outgoing, self._outgoing = self._outgoing, []
        for stretch in self._fresh:
            outgoing += [AddressedMessage(None, each) for each in pack_entries(stretch, self._bytes_max)]
        self._fresh.clear()
        if tick >= self._beacon_at:
            self._beacon_at = tick + BEACON_TICKS
            leading = []
            if own is not None:
                self._registers.merge(own(), tick)
                leading = [self._me]
            most = min(_REGISTERS_MAX, max(1, (self._bytes_max - _BEACON_BYTES) // self._register_bytes()))
            beacon = RegisterBeacon(self._replica.digest, self._registers.to_send(leading, most, tick))
            outgoing.append(AddressedMessage(None, beacon))
        if tick >= self._sync_at:
            outgoing += self._ask(tick)
        return outgoing

    def _register_bytes(self) -> int:
        """Return the size of the largest register if few fit into a beacon, and else the usual size [bytes]."""
        if self._bytes_max >= LARGE_BYTES:
            return _REGISTER_BYTES
        return max([_REGISTER_BYTES, *map(register_bytes, self._registers.newest.values())])

    def _ask(self, tick: int) -> list[AddressedMessage]:
        """Return the version vector for one node with another digest: the one to which it was sent longest ago."""
        waiting = [node for node, since in self._differs.items() if tick - since <= DIFFERS_TICKS]
        if not waiting:
            return []
        partner = min(waiting, key=lambda node: (self._synced.get(node, -1), node))
        del self._differs[partner]
        self._synced[partner] = tick
        self._sync_at = tick + SYNC_TICKS
        return [
            AddressedMessage(partner, each) for each in pack_vector(self._replica.vector, self._bytes_max, ask=True)
        ]

    def _answer(self, sender: int, vector: Vector, tick: int) -> None:
        theirs, mine = counts_of(vector), self._replica.vector
        origins = [origin for origin in sorted(mine) if vector.low <= origin < vector.high]
        for stretch in self._replica.missing(theirs, origins, self._answer_max):
            self._outgoing += [AddressedMessage(sender, each) for each in pack_entries(stretch, self._bytes_max)]
        if any(count > mine.get(origin, 0) for origin, count in theirs.items()):
            self._differs[sender] = tick
