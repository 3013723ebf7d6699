"""The same value everywhere."""

from zwerm.scenario.types import Finite, Table
from zwerm.world.fields.linear import Linear


class Constant(Linear):
    """The same `value` everywhere."""

    class Parameters(Table):
        """The value."""

        value: Finite

    def __init__(self, value: float) -> None:
        super().__init__(value, (0.0, 0.0))
