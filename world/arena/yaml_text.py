"""Reading YAML of unknown origin."""

from typing import Any, Final

import yaml

NESTING_MAX: Final = 64


def parse_yaml(text: str) -> Any:
    """Return what a YAML text holds.

    Raises yaml.YAMLError also for aliases, by which a short text can stand for billions of values, and for nesting without end.
    """
    try:
        depth = 0
        for event in yaml.parse(text):
            if isinstance(event, yaml.AliasEvent):
                raise yaml.MarkedYAMLError(problem="aliases are not allowed")
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > NESTING_MAX:
                raise yaml.MarkedYAMLError(problem="it is nested too deeply")
        return yaml.safe_load(text)
    except ValueError as error:  # a number of thousands of digits
        raise yaml.MarkedYAMLError(problem=str(error).partition(";")[0]) from None
