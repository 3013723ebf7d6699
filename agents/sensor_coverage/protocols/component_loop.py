"""The loop over a robot's components: deliver, poll, collect, and find the next wake-up."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from zwerm.agents.sensor_coverage.messages.command_size import fitting
from zwerm.agents.sensor_coverage.messages.incarnations import ANY, Incarnations
from zwerm.agents.sensor_coverage.messages.peers import read_envelope, write
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.agents.sensor_coverage.protocols.transport.loss_estimate import LossEstimate
from zwerm.wire.messages import Packet, Transmission

# Sender of a packet on a channel that does not name senders.
ANONYMOUS = -1


class Codec(NamedTuple):
    """Functions that read (None: corrupt) and write the messages of one channel.

    With `in_envelopes` the messages are those between neighbours, in envelopes and in copies. Packets of such a channel
    without a named sender are ignored.
    """

    read: Callable[[bytes], Any]
    write: Callable[[Any], bytes]
    in_envelopes: bool = False


class ComponentLoop:
    """Runs components in the given order; `codecs` has a codec for each radio channel that they use.

    `incarnation` is that of this node. Messages from or to former incarnations are dropped on arrival.
    """

    def __init__(self, components: Sequence[Component], codecs: Mapping[str, Codec], incarnation: int = 1) -> None:
        self._components = components
        # A robot that hears its neighbours steps often, and most components do not take part in each stage.
        self._idle = [each.is_idle for each in components if type(each).is_idle is not Component.is_idle]
        self._polled = [each.poll for each in components if type(each).poll is not Component.poll]
        self._senders = [
            (each.channel, each.outgoing) for each in components if type(each).outgoing is not Component.outgoing
        ]
        self._wakers = [each.next_wake for each in components if type(each).next_wake is not Component.next_wake]
        self._codecs = codecs
        self.losses = LossEstimate()
        self._incarnations = Incarnations(incarnation)
        self._broadcasts = 0
        self._unsent: list[Transmission] = []  # packets that did not fit into the latest command
        self._receivers: dict[type[Any], list[Component]] = {}
        for component in components:
            for kind in component.accepts:
                self._receivers.setdefault(kind, []).append(component)

    def deliver(self, inbox: Sequence[Packet], tick: int) -> bool:
        """Read the packets of this tick, and dispatch their messages; corrupt packets and copies are ignored.

        Return whether any of them said something new.
        """
        if not inbox:
            return False
        news = False
        arrived: dict[tuple[int, bytes], int] = {}
        for packet in inbox:
            codec = self._codecs.get(packet.channel)
            sender = ANONYMOUS if packet.sender is None else packet.sender
            if codec is None or (codec.in_envelopes and packet.sender is None):
                continue
            if codec.in_envelopes:
                arrived[sender, packet.payload] = arrived.get((sender, packet.payload), 0) + 1
            elif (message := codec.read(packet.payload)) is not None:
                news |= self.dispatch(sender, message, tick)
        for (sender, payload), copies in arrived.items():
            message = self._opened(sender, payload, copies, tick)
            if message is not None:
                news |= self.dispatch(sender, message, tick)
        return news

    def _opened(self, sender: int, payload: bytes, arrived: int, tick: int) -> Any:
        """Return the message in an envelope; None if it is corrupt, or from or to a former incarnation."""
        envelope = read_envelope(payload)
        if envelope is None or not self._incarnations.is_current(sender, envelope.sender, envelope.receiver):
            return None
        if self._incarnations.is_restart(sender, envelope.sender):
            self.losses.forget(sender)
            for component in self._components:
                component.restarted(sender, tick)
        if envelope.number:
            self.losses.receive(sender, envelope.number, envelope.copies, arrived)
        return envelope.message

    def dispatch(self, sender: int, message: Any, tick: int) -> bool:
        """Give one message to every component that accepts its type; return whether it said something new to any."""
        news = False
        for component in self._receivers.get(type(message), ()):
            if component.receive(sender, message, tick) is not False:
                news = True
        return news

    def is_idle(self, tick: int) -> bool:
        """Return whether no component has anything to do before `next_wake`, if no message said something new."""
        if self._unsent:
            return False
        for is_idle in self._idle:  # noqa: SIM110 (asked at most steps: a generator takes twice as long)
            if not is_idle(tick):
                return False
        return True

    def poll(self, tick: int) -> None:
        """Poll every component."""
        for poll in self._polled:
            poll(tick)

    def outbox(self, bytes_taken: int = 0) -> tuple[Transmission, ...]:
        """Return the packets to send in this tick; `bytes_taken` of the command are in use already.

        Packets that do not fit into the command are sent in the next ticks, before components are asked for more.
        """
        unsent = self._unsent
        if not unsent:
            for channel, outgoing in self._senders:
                for each in outgoing():
                    unsent += self._transmissions(channel, each)
        count = fitting(unsent, bytes_taken)
        self._unsent = unsent[count:]
        return tuple(unsent[:count])

    def _transmissions(self, channel: str, outgoing: Outgoing) -> list[Transmission]:
        """Return the packets of one message: in envelopes, with the number of copies that the radio's losses require."""
        codec, (to, message) = self._codecs[channel], outgoing
        if not codec.in_envelopes:
            return [Transmission(channel, codec.write(message), to)]
        known, copies = self._incarnations, self.losses.copies
        if to is None:
            self._broadcasts += 1
            payload = write(message, known.own, ANY, self._broadcasts, copies)
        else:
            payload = write(message, known.own, known.of(to), 0, copies)
        return [Transmission(channel, payload, to)] * copies

    def next_wake(self) -> int | None:
        """Return the earliest wake-up of a component, or None; an earlier tick than the present one while packets wait."""
        earliest: int | None = 0 if self._unsent else None
        for next_wake in self._wakers:
            wake = next_wake()
            if wake is not None and (earliest is None or wake < earliest):
                earliest = wake
        return earliest
