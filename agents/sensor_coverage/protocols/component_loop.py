"""The loop over a robot's components: deliver, poll, collect, and find the next wake-up."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from zwerm.agents.sensor_coverage.protocols.component import Component
from zwerm.wire.messages import Packet, Transmission

# Sender of a packet on a channel that does not tell it.
ANONYMOUS = -1


class Codec(NamedTuple):
    """Functions that read (None: corrupt) and write the messages of one channel.

    With `needs_sender` packets whose sender is not told are ignored.
    """

    read: Callable[[bytes], Any]
    write: Callable[[Any], bytes]
    needs_sender: bool = False


class ComponentLoop:
    """Runs components in the given order; `codecs` has a codec for each radio channel that they use."""

    def __init__(self, components: Sequence[Component], codecs: Mapping[str, Codec]) -> None:
        self._components = components
        self._codecs = codecs
        self._receivers: dict[type[Any], list[Component]] = {}
        for component in components:
            for kind in component.accepts:
                self._receivers.setdefault(kind, []).append(component)

    def deliver(self, inbox: Iterable[Packet], tick: int) -> None:
        """Read the packets of this tick, and dispatch their messages; corrupt packets are ignored."""
        for packet in inbox:
            codec = self._codecs.get(packet.channel)
            if codec is None or (codec.needs_sender and packet.sender is None):
                continue
            message = codec.read(packet.payload)
            if message is not None:
                self.dispatch(ANONYMOUS if packet.sender is None else packet.sender, message, tick)

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
            Transmission(component.channel, self._codecs[component.channel].write(each.message), each.to)
            for component in self._components
            for each in component.outgoing()
        )

    def next_wake(self) -> int | None:
        """Return the earliest tick at which a component wants to be polled, or None."""
        wakes = (component.next_wake() for component in self._components)
        return min((each for each in wakes if each is not None), default=None)
