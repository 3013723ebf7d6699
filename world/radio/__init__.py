"""The radio: every packet between nodes passes here, and every packet is accounted for.

A **model** is one reason why a packet may not arrive, or not as it was sent. It judges the packets of a tick together and
returns a verdict for each: dropped, delayed, copied or damaged. The models of a channel judge in the order of the
scenario; what one drops the next never sees. `models` holds one file a model, `registry` names them, `medium` runs them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from zwerm.maths.keyed_random import Draws
from zwerm.scenario.types import Table
from zwerm.world.arena.arena import Arena
from zwerm.world.radio.links import LinkDraws, Links
from zwerm.world.scene import Bools, Floats, Ints, Scene

# From robot to robot, and between any robot and the coordinator.
ROBOTS: Final = "robots"
UPLINK: Final = "uplink"

NodeName = int | Literal["base", "coordinator"]


class LinkTable(Table):
    """Parameters of a model. Those of every model: who sends and who receives what it judges, all where it does not say.

    `name` keys the model's randomness, in place of its kind and how many of that kind stand before it.
    """

    name: str = ""
    senders: list[NodeName] | None = None
    receivers: list[NodeName] | None = None


@dataclass(slots=True)
class Air:
    """What is sent on one channel at one tick. Arrays have one row per transmission: a broadcast is one."""

    scene: Scene
    dt_s: float
    sender: Ints  # (t,)
    rank: Ints  # (t,) how many the same sender sent on this channel at this tick before it
    payloads: list[bytes]  # one per transmission, and then the damaged ones

    @property
    def tick(self) -> int:
        """The tick of sending."""
        return self.scene.tick

    def sizes(self) -> Ints:
        """Return the sizes of `payloads` [bytes]."""
        return np.fromiter(map(len, self.payloads), np.int64, len(self.payloads))


@dataclass(slots=True)
class Packets:
    """The packets that are still in the air, arrays (k,). A transmission is one packet for every node it is meant for."""

    links: Links
    link: Ints  # which row of `links`
    transmission: Ints  # which row of Air
    payload: Ints  # which of Air.payloads
    key: NDArray[np.uint64]  # keys the packet's draws: its tick, rank and copy
    copy: Ints | None = None  # 0 for the packet as sent; None where all are
    delay_s: Floats | None = None  # after sending; None where all are 0
    attenuation_db: Floats | None = None  # by what stands in the way; None where nothing does

    def __len__(self) -> int:
        return len(self.link)

    @property
    def sender(self) -> Ints:
        """(k,) node ids."""
        sender: Ints = self.links.sender[self.link]
        return sender

    @property
    def receiver(self) -> Ints:
        """(k,) node ids."""
        receiver: Ints = self.links.receiver[self.link]
        return receiver

    def take(self, rows: Ints | Bools) -> "Packets":
        """Return the packets at `rows`."""

        def part(values: Any) -> Any:
            return None if values is None else values[rows]

        return Packets(
            self.links,
            self.link[rows],
            self.transmission[rows],
            self.payload[rows],
            self.key[rows],
            part(self.copy),
            part(self.delay_s),
            part(self.attenuation_db),
        )

    def layers(self, air: Air) -> Iterator[Ints]:
        """Yield rows in the order of sending, such that no link appears twice in one array."""
        order = air.rank[self.transmission]
        if self.copy is not None:
            order = order * (int(self.copy.max(initial=0)) + 1) + self.copy
        if not order.any():
            yield np.arange(len(self))
            return
        for layer in np.unique(order).tolist():
            yield np.flatnonzero(order == layer)


class Verdict(NamedTuple):
    """What becomes of k packets; None means that nothing of the kind happens to any."""

    drop: Bools | None = None  # (k,)
    after_s: Floats | None = None  # (k,) added delay [s]
    copies: Ints | None = None  # (k,) how many copies arrive besides it
    payload: Ints | None = None  # (k,) which of Air.payloads it carries now
    attenuation_db: Floats | None = None  # (k,) added attenuation [dB]


@dataclass(frozen=True, slots=True)
class ModelPlace:
    """Where a model stands: what it may know before the first packet."""

    links: Links
    draws: Draws
    purpose: str  # keys its draws
    nodes: int
    dt_s: float
    arena: Arena

    def link_draws(self, what: str = "") -> LinkDraws:
        """Return draws of this model's own, by link and packet."""
        return LinkDraws(self.draws, self.purpose + what, self.links)


class LinkModel(Protocol):
    """One reason why a packet may not arrive; `needs_positions` means that it makes sense between bodies only.

    A model with an attribute `out_of_reach` that is true drops packets to receivers that are out of reach, by no chance. The
    others lose packets to receivers in reach.
    """

    kind: ClassVar[str]
    cause: ClassVar[str]
    needs_positions: ClassVar[bool]
    Parameters: ClassVar[type[LinkTable]]

    def __init__(self, parameters: Any, place: ModelPlace) -> None:
        """Take an instance of `Parameters`. Raises ValueError, one line, where they make no sense together."""

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Return what becomes of `packets`."""
