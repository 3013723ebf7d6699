"""Rules by which a real network reproduces a radio model. `zwerm.deploy.network.impairments` installs them.

A network has four mechanisms, one class each: blocked pairs, random loss, a rate at the sender, and a delay at the
receiver.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BlockedPairs:
    """No packet passes between some pairs of nodes. The world computes the pairs at every tick.

    The model must judge by positions alone: without random numbers, delays, copies and damage.
    """


@dataclass(frozen=True, slots=True)
class RandomLoss:
    """A packet is lost with probability `lose`.

    With `bursts`, `lose` applies in the bad state of a link only. `enter` and `leave` are the probabilities per packet of
    entering and leaving the bad state.
    """

    lose: float
    bursts: bool = False
    enter: float = 1.0
    leave: float = 0.0


@dataclass(frozen=True, slots=True)
class SenderRate:
    """A token bucket at the sender: `rate_bytes_s` for each transmission, and a queue of `queue_bytes`."""

    rate_bytes_s: float
    queue_bytes: float


@dataclass(frozen=True, slots=True)
class ReceiverDelay:
    """A delay before the receiver, uniform over `mean_s` - `deviation_s` to `mean_s` + `deviation_s`."""

    mean_s: float
    deviation_s: float


NetworkRule = BlockedPairs | RandomLoss | SenderRate | ReceiverDelay
