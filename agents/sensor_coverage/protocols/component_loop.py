"""The loop over a robot's components: deliver, poll, collect, and find the next wake-up."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from zwerm.agents.sensor_coverage.messages.incarnations import ANY, Incarnations
from zwerm.agents.sensor_coverage.messages.peers import Envelope
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.wire.messages import Packet, Transmission

# Sender of a packet on a channel that does not tell it.
ANONYMOUS = -1


class Codec(NamedTuple):
    """Functions that read (None: corrupt) and write the messages of one channel.

    With `in_envelopes` messages are in envelopes: `read` returns an `Envelope`, and `write` takes the incarnations of
    sender and receiver as well. Packets of such a channel whose sender is not told are ignored.
    """

    read: Callable[[bytes], Any]
    write: Callable[..., bytes]
    in_envelopes: bool = False


class ComponentLoop:
    """Runs components in the given order; `codecs` has a codec for each radio channel that they use.

    `incarnation` is that of this node. Messages from or to former incarnations are dropped at the door.
    """

    def __init__(self, components: Sequence[Component], codecs: Mapping[str, Codec], incarnation: int = 1) -> None:
        self._components = components
        self._codecs = codecs
        self._incarnations = Incarnations(incarnation)
        self._receivers: dict[type[Any], list[Component]] = {}
        for component in components:
            for kind in component.accepts:
                self._receivers.setdefault(kind, []).append(component)

    def deliver(self, inbox: Iterable[Packet], tick: int) -> None:
        """Read the packets of this tick, and dispatch their messages; corrupt packets are ignored."""
        for packet in inbox:
            codec = self._codecs.get(packet.channel)
            if codec is None or (codec.in_envelopes and packet.sender is None):
                continue
            message = codec.read(packet.payload)
            sender = ANONYMOUS if packet.sender is None else packet.sender
            if message is not None and codec.in_envelopes:
                message = self._opened(sender, message, tick)
            if message is not None:
                self.dispatch(sender, message, tick)

    def _opened(self, sender: int, envelope: Envelope, tick: int) -> Any:
        """Return the message in an envelope, or None if it is from or to a former incarnation."""
        if not self._incarnations.is_current(sender, envelope.sender, envelope.receiver):
            return None
        if self._incarnations.is_restart(sender, envelope.sender):
            for component in self._components:
                component.restarted(sender, tick)
        return envelope.message

    def dispatch(self, sender: int, message: Any, tick: int) -> None:
        """Give one message to every component that accepts its type."""
        for component in self._receivers.get(type(message), ()):
            component.receive(sender, message, tick)

    def poll(self, tick: int) -> None:
        """Poll every component."""
        for component in self._components:
            component.poll(tick)

    def outbox(self) -> tuple[Transmission, ...]:
        """Return the packets to send in this tick."""
        return tuple(
            Transmission(component.channel, self._written(component.channel, each), each.to)
            for component in self._components
            for each in component.outgoing()
        )

    def _written(self, channel: str, outgoing: Outgoing) -> bytes:
        codec = self._codecs[channel]
        if not codec.in_envelopes:
            return codec.write(outgoing.message)
        known = self._incarnations
        return codec.write(outgoing.message, known.own, ANY if outgoing.to is None else known.of(outgoing.to))

    def next_wake(self) -> int | None:
        """Return the earliest tick at which a component wants to be polled, or None."""
        wakes = (component.next_wake() for component in self._components)
        return min((each for each in wakes if each is not None), default=None)
