"""Heal: ends all active faults of the radio and of sensors, and of nodes that are paused or slow. Crashed nodes stay down."""

from typing import ClassVar

from zwerm.world.faults import Fault


class Heal(Fault):
    """Ends other faults."""

    lasts: ClassVar[bool] = False
    healable: ClassVar[bool] = False
    heals: ClassVar[bool] = True
    in_network: ClassVar[bool] = True
