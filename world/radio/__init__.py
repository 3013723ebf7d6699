"""Radio: all packets between nodes, and the ledger that counts every packet.

A **radio model** is one reason why a packet does not arrive, or not as it was sent. It judges the packets of a tick
together and returns a verdict for each packet: dropped, delayed, copied or damaged. The models of a channel judge in the
order of the scenario; a packet that one model drops does not reach the next. `models` holds one file per model; the catalogue
names them.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from zwerm.maths.keyed_random import Draws
from zwerm.scenario.types import Table
from zwerm.world.arena.arena import Arena
from zwerm.world.radio.links import LinkRandom, Links
from zwerm.world.radio.network_rules import NetworkRule
from zwerm.world.scene import Bools, Floats, Ints, Scene

# Channels: from robot to robot, and between any robot and the coordinator.
ROBOTS: Final = "robots"
UPLINK: Final = "uplink"

NodeName = int | Literal["base", "coordinator"]


class RadioModelTable(Table):
    """Parameters that every model has: it judges only packets from `senders` to `receivers`, by default those of all nodes.

    `name` keys the random numbers of the model, in place of its kind and its number among the models of that kind.
    """

    name: str = ""
    senders: list[NodeName] | None = None
    receivers: list[NodeName] | None = None


@dataclass(slots=True)
class Transmissions:
    """The transmissions of one channel at one tick. Arrays have one row per transmission: a broadcast is one."""

    scene: Scene
    dt_s: float
    sender: Ints  # (t,)
    rank: Ints  # (t,) number of earlier transmissions of the same sender on this channel at this tick
    payloads: list[bytes]  # one per transmission; models append damaged payloads

    @property
    def tick(self) -> int:
        """The tick of sending."""
        return self.scene.tick

    def sizes(self) -> Ints:
        """Return the sizes of `payloads` [bytes]."""
        return np.fromiter(map(len, self.payloads), np.int64, len(self.payloads))


@dataclass(slots=True)
class Packets:
    """Packets that no model has dropped yet, arrays (k,). A transmission is one packet for each of its receivers."""

    links: Links
    link: Ints  # row of `links`
    transmission: Ints  # row of Transmissions
    payload: Ints  # index in Transmissions.payloads
    key: NDArray[np.uint64]  # keys the random numbers of the packet: its tick, rank and copy
    copy: Ints | None = None  # 0 for the packet as sent; None where all are
    delay_s: Floats | None = None  # after sending; None where all are 0
    attenuation_db: Floats | None = None  # by obstacles; None where there is none

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

    def layers(self, sent: Transmissions) -> Iterator[Ints]:
        """Yield rows in the order of sending, such that no link appears twice in one array."""
        order = sent.rank[self.transmission]
        if self.copy is not None:
            order = order * (int(self.copy.max(initial=0)) + 1) + self.copy
        if not order.any():
            yield np.arange(len(self))
            return
        for layer in np.unique(order).tolist():
            yield np.flatnonzero(order == layer)


class Verdict(NamedTuple):
    """Effects on k packets. None means no effect of this kind on any packet."""

    drop: Bools | None = None  # (k,)
    after_s: Floats | None = None  # (k,) added delay [s]
    copies: Ints | None = None  # (k,) number of copies that arrive besides the packet
    payload: Ints | None = None  # (k,) new index in Transmissions.payloads
    attenuation_db: Floats | None = None  # (k,) added attenuation [dB]


@dataclass(frozen=True, slots=True)
class ModelContext:
    """The constants of a run that a model may know. `purpose` keys its random numbers."""

    links: Links
    draws: Draws
    purpose: str
    nodes: int
    dt_s: float
    arena: Arena

    def link_random(self, suffix: str = "") -> LinkRandom:
        """Return random numbers of this model, keyed by link and packet."""
        return LinkRandom(self.draws, self.purpose + suffix, self.links)


class PacketJudge(Protocol):
    """The part of a model that a channel uses. Radio faults have it, too."""

    @property
    def cause(self) -> str:
        """The name under which the ledger counts dropped packets."""

    @property
    def out_of_reach(self) -> bool:
        """True if receivers of dropped packets are out of reach. Otherwise the packets are losses."""

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Return the effects on `packets`."""


class RadioModel(ABC):
    """One reason why a packet does not arrive as it was sent: the base class of the plug-in kind `radio model`.

    A subclass states here all that other parts need to know about it.
    """

    Parameters: ClassVar[type[RadioModelTable]] = RadioModelTable
    # Parameters of an example. The tests try the model with them, and the reference page shows them.
    example: ClassVar[Mapping[str, Any]] = {}

    # The name under which the ledger counts the packets that the model drops.
    cause: ClassVar[str] = "lost"
    # The key of its random numbers in place of the kind that the scenario names; for a model whose kind was renamed.
    draw_key: ClassVar[str] = ""
    # The model is defined between bodies only: not on the channel to the coordinator.
    needs_positions: ClassVar[bool] = False
    # The receivers of dropped packets are out of reach, without randomness. Otherwise the packets are losses.
    out_of_reach: ClassVar[bool] = False
    # The verdict on a packet depends on no other packet: the channel need not show it packets that a later model drops.
    memoryless: ClassVar[bool] = False

    # The model drops every packet over more than this distance [m].
    range_max_m: float = math.inf

    @abstractmethod
    def __init__(self, parameters: Any, context: ModelContext) -> None:
        """Take an instance of `Parameters`. Raises ValueError, one line, if they contradict each other."""

    @abstractmethod
    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Return the effects on `packets`, which are those of `sent` that no earlier model dropped."""

    @property
    def reach_m(self) -> float:
        """The distance [m] beyond which the channel shows the model no broadcast: it counts the packets as dropped by it.

        A model without a sharp edge states the distance beyond which it would let a packet pass with a negligible probability.
        While no model of a channel has a bound, the models judge all pairs of nodes.
        """
        return self.range_max_m

    @classmethod
    def network_rule(cls, parameters: Any) -> NetworkRule | None:
        """Return the rule by which a real network reproduces this model, or None if no rule is known.

        Raises ValueError with the reason, one line, if no network can reproduce it with these parameters.
        """
        return None
