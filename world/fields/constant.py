"""The same value everywhere."""

from typing import ClassVar

from zwerm.scenario.types import Finite, Table
from zwerm.world.fields.linear import Linear


class ConstantTable(Table):
    """The value."""

    value: Finite


class Constant(Linear):
    """The same `value` everywhere."""

    Parameters: ClassVar[type[Table]] = ConstantTable

    def __init__(self, value: float) -> None:
        super().__init__(value, (0.0, 0.0))
