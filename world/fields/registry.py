"""Fields by name: those of the catalogue, and `module:Class` for any other."""

from pathlib import Path

from pydantic import ValidationError

from zwerm.catalogue import FIELDS
from zwerm.errors import ScenarioError
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.plugin_names import class_named
from zwerm.scenario.types import OpenTable
from zwerm.world.fields import Box, Field, FieldPlace


def find(kind: str) -> type[Field]:
    """Return the class that `kind` names. Raises ValueError, in one line, where there is none or it is no field."""
    found = class_named(FIELDS.get(kind, kind), "field", FIELDS)
    if not issubclass(found, Field):
        raise ValueError(f"{kind} is no field: expected a subclass of zwerm.Field")
    return found


def make_field(table: OpenTable, bounds_m: Box, folder: Path, place: str, path: str = "field") -> Field:
    """Return the field that `table` describes, in an arena with `bounds_m`; file names are relative to `folder`.

    Raises ScenarioError with every mistake, each `place: path.key: rule, got value`.
    """
    try:
        kind = find(table.kind)
    except ValueError as error:
        raise ScenarioError([f"{place}: {path}.kind: {error}"]) from None
    try:
        parameters = kind.Parameters.model_validate(table.parameters)
    except ValidationError as error:
        raise ScenarioError(mistakes(error, place, f"{path}.", kind.Parameters)) from None
    try:
        return kind.make(parameters, FieldPlace(bounds_m, folder))
    except ValueError as error:
        raise ScenarioError([f"{place}: {path}.{error}"]) from None
