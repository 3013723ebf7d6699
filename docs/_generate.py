"""The parts of the documentation that come from the code: tables, sensors, messages, commands.

`pages.py` writes what a function of GENERATED returns into the pages, below the line `<!-- generated: NAME -->`. A test checks
that every name is known, used and up to date.
"""

import inspect
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import msgspec
import tomli_w
import typer
from _objects import object_fields, public_names
from pydantic import BaseModel

from zwerm.agents.runtime import controllers
from zwerm.catalogue import (
    ALGORITHMS,
    BASE,
    COORDINATOR,
    FAULTS,
    FIELDS,
    METRICS,
    RADIO_MODELS,
    ROBOT,
    SENSORS,
    names,
    row_of,
)
from zwerm.cli.app import app
from zwerm.scenario.load import built_in, load
from zwerm.scenario.plugin_names import class_named
from zwerm.scenario.tables import Scenario, metrics_table
from zwerm.scenario.types import OpenTable
from zwerm.study.study_tables import StudyTable
from zwerm.wire import messages as protocol
from zwerm.world.faults import FaultTable
from zwerm.world.faults import registry as faults
from zwerm.world.fields import registry as fields
from zwerm.world.metrics import Metric
from zwerm.world.radio import RadioModel, RadioModelTable
from zwerm.world.radio import registry as radio
from zwerm.world.sensors import registry as sensors

# --- from JSON schemas to words -------------------------------------------------------------------------------------

Schema = dict[str, Any]


def in_words(schema: Schema) -> str:
    """Return the values that a schema allows, in words: `number > 0`, `[number, number]`, `array of string`."""
    if "$ref" in schema:
        return "table"
    if "anyOf" in schema:
        return " or ".join(in_words(each) for each in schema["anyOf"] if each.get("type") != "null")
    if "const" in schema or "enum" in schema:
        return " or ".join(f'"{each}"' for each in schema.get("enum", [schema.get("const")]))
    kind = str(schema.get("type"))
    if kind in ("integer", "number"):
        return kind + _limits(schema)
    if kind == "array" and "prefixItems" in schema:
        return "[" + ", ".join(in_words(each) for each in schema["prefixItems"]) + "]"
    if kind == "array":
        item, least, most = in_words(schema.get("items", {})), schema.get("minItems"), schema.get("maxItems")
        if least and most:
            return f"array of {least} to {most} {item}s"
        return f"array of {item}{f', {least} at least' if least else ''}".replace("array of array", "array of arrays")
    return {"boolean": "true or false", "object": "table", "string": "string"}.get(kind, "any")


def _limits(schema: Schema) -> str:
    low, high = schema.get("minimum"), schema.get("maximum")
    if low is not None and high is not None:
        return f" {low:g} to {high:g}"
    limits = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    return "".join(f" {sign} {schema[key]:g}" for key, sign in limits.items() if key in schema)


def as_toml(value: Any) -> str:
    """Return a default as a scenario would have it, or nothing where there is none to show."""
    if value is None or isinstance(value, dict):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value}`" if not isinstance(value, str) else f'`"{value}"`'


def rows(schema: Schema, links: dict[str, str] | None = None) -> str:
    """Return the keys of an object's schema as a Markdown table; `links` lead to tables of their own."""
    required = schema.get("required", [])
    lines = ["| key | value | default |", "| --- | --- | --- |"]
    for name, each in schema.get("properties", {}).items():
        default = "required" if name in required else as_toml(each.get("default"))
        value = (links or {}).get(name) or escaped(in_words(each))
        lines.append(f"| `{name}` | {value} | {escaped(default)} |")
    return "\n".join(lines) if schema.get("properties") else "No parameters."


def escaped(text: str) -> str:
    """Return text that cannot end a cell of a Markdown table."""
    return text.replace("|", "\\|")


def first_paragraph(text: str | None) -> str:
    """Return a docstring's first paragraph on one line."""
    return " ".join(inspect.cleandoc(text or "").split("\n\n")[0].split())


def paragraphs(text: str | None) -> str:
    """Return a docstring as Markdown."""
    return inspect.cleandoc(text or "")


# --- scenarios ------------------------------------------------------------------------------------------------------


def scenario_tables() -> str:
    """Return every table of a scenario with its keys."""
    return _tables(Scenario, "a scenario")


def study_tables() -> str:
    """Return every table of a study with its keys."""
    return _tables(StudyTable, "a study")


def _tables(model: type[BaseModel], root: str) -> str:
    schema = model.model_json_schema()
    definitions = schema.get("$defs", {})
    if "MetricsTable" in definitions:  # its keys are rows of the catalogue
        metrics = metrics_table().model_json_schema()
        definitions |= metrics.pop("$defs", {}) | {"MetricsTable": metrics}
    parts: list[str] = []

    def describe(table: Schema, path: str, title: str) -> None:
        parts.append(f"{heading(title, anchor(path or root))}\n\n{paragraphs(table.get('description'))}")
        inner = {key: found for key, each in table.get("properties", {}).items() if (found := _table_in(each))}
        below = {key: f"{path}.{key}" if path else key for key in inner}
        parts.append(rows(table, {key: f"[{words}](#{anchor(below[key])})" for key, (_, words) in inner.items()}))
        for key, (name, words) in inner.items():
            describe(definitions[name], below[key], TITLES[words].format(below[key]))

    describe(schema, "", f"The top of {root}")
    return "\n\n".join(parts)


TITLES: Final = {"table": "`[{}]`", "array of tables": "`[[{}]]`", "table of tables": "`[{}.NAME]`"}


def _table_in(schema: Schema) -> tuple[str, str] | None:
    """Return the name of the table that a key holds and whether it is one or many; None for any other key."""
    for each in [schema, *schema.get("anyOf", [])]:
        parts = (each, each.get("items", {}), each.get("additionalProperties", {}))
        for part, words in zip(parts, TITLES, strict=True):
            name = part.get("$ref", "").rpartition("/")[2] if isinstance(part, dict) else ""
            if name and name != OpenTable.__name__:  # a plug-in's own: the page lists those by kind
                return name, words
    return None


def heading(text: str, name: str) -> str:
    """Return a heading that is linked by `name`, on a site and on a code host alike."""
    return f'<a id="{name}"></a>\n\n### {text}'


def anchor(path: str) -> str:
    """Return the name a heading is linked by."""
    return "table-" + re.sub(r"[^a-z0-9]+", "-", path.lower()).strip("-")


def built_in_scenarios() -> str:
    """Return the scenarios that ship with Zwerm."""
    lines = ["| scenario | robots | lasts | what it is |", "| --- | --- | --- | --- |"]
    for name in built_in():
        each = load(name)
        lines.append(f"| `{name}` | {each.robots.count} | {each.time.duration_s:g} s | {escaped(each.summary)} |")
    return "\n".join(lines)


# --- plug-ins -------------------------------------------------------------------------------------------------------


def sensor_list() -> str:
    """Return every built-in sensor: description, field of the observation and parameters."""
    parts = []
    for kind, found in ((kind, sensors.find(kind)) for kind in SENSORS):
        module = inspect.getmodule(found)
        text = module.__doc__ if module else found.__doc__
        parts.append(f"{heading(f'`{kind}`', 'sensor-' + kind.replace('_', '-'))}\n\n{paragraphs(text)}")
        parts.append(f"Fills `{found.field}` of the observation.")
        parts.append(rows(found.Parameters.model_json_schema()))
        parts += _example("robots.sensors", kind, found)
    return "\n\n".join(parts)


def radio_models() -> str:
    """Return every radio model: description, cause and parameters."""
    return _kinds({kind: radio.find(kind) for kind in RADIO_MODELS}, RadioModelTable, "radio.models")


def fault_list() -> str:
    """Return every kind of fault and its parameters."""
    return _kinds({kind: faults.find(kind) for kind in FAULTS}, FaultTable, "faults")


def _kinds(kinds: Mapping[str, type[Any]], base: type[BaseModel], array: str) -> str:
    parts = []
    for kind, found in kinds.items():
        schema = found.Parameters.model_json_schema()
        own = {key: each for key, each in schema["properties"].items() if key not in base.model_fields}
        parts.append(f"### `{kind}`\n\n{paragraphs(sys.modules[found.__module__].__doc__)}")
        cause = getattr(found, "cause", RadioModel.cause)
        if cause != RadioModel.cause:
            parts.append(f"Drops for `{cause}`.")
        if own:
            parts.append(rows(schema | {"properties": own}))
        parts += _example(array, kind, found)
    return "\n\n".join(parts)


def _example(array: str, kind: str, found: type[Any]) -> list[str]:
    """Return the example of a plug-in as an item of the array of tables `array` of a scenario, where it has one."""
    example = getattr(found, "example", {})
    table = tomli_w.dumps({"kind": kind, **example}).strip()
    return [f'```toml title="Part of a scenario"\n[[{array}]]\n{table}\n```'] if example else []


def field_list() -> str:
    """Return every kind of scalar field and its parameters."""
    parts = []
    for kind, found in ((kind, fields.find(kind)) for kind in FIELDS):
        parts.append(f"{heading(f'`{kind}`', f'field-{kind}')}\n\n{paragraphs(found.__doc__)}")
        parts.append(rows(found.Parameters.model_json_schema()))
    return "\n\n".join(parts)


def controller_list() -> str:
    """Return every built-in controller and its parameters."""
    return "\n\n".join(_controller(f"`{name}`", f"controller-{name}", name) for name in names(ROBOT))


def part_list() -> str:
    """Return every built-in base station and coordinator, and their parameters."""
    return "\n\n".join(
        _controller(f"`{name}`, {role}", f"{role}-{name}", where)
        for role in (BASE, COORDINATOR)
        for row in ALGORITHMS
        for name, where in row.controllers.get(role, {}).items()
    )


def _controller(title: str, anchor: str, name: str) -> str:
    found = controllers.find(name)
    parameters = controllers.parameters_of(found)
    needs = ", ".join(f"`{each}`" for each in getattr(found, "sensors", ())) or "no sensor"
    (schema,), components = msgspec.json.schema_components([parameters])
    return (
        f"{heading(title, anchor)}\n\n{paragraphs(found.__doc__)}\n\nNeeds {needs}.\n\n"
        f"{paragraphs(parameters.__doc__)}\n\n{rows(components[schema['$ref'].rpartition('/')[2]])}"
    )


# --- the wire -------------------------------------------------------------------------------------------------------

MESSAGES: Final = (
    protocol.Observation, protocol.Command, protocol.Failure, protocol.Hello, protocol.Welcome, protocol.Goodbye
)  # fmt: skip


def messages() -> str:
    """Return every message and every part of one."""
    of_protocol = [each for _, each in inspect.getmembers(protocol, _is_struct) if not each.__name__.startswith("_")]
    parts = sorted((each for each in of_protocol if each not in MESSAGES), key=lambda each: each.__name__)
    return "\n\n".join(map(_struct, [*MESSAGES, *parts]))


def _is_struct(found: object) -> bool:
    return isinstance(found, type) and issubclass(found, msgspec.Struct) and found.__module__ == protocol.__name__


def _struct(struct: type[msgspec.Struct]) -> str:
    config = struct.__struct_config__
    shape = "An array" if config.array_like else "A map"
    tag = f' with `"{config.tag_field}": "{config.tag}"`' if config.tag else ""
    lines = ["| field | type | default |", "| --- | --- | --- |"]
    for each in msgspec.structs.fields(struct):
        default = None if isinstance(each.default, msgspec.Raw) else each.default
        given = "required" if each.required else f"`{default!r}`"
        lines.append(f"| `{each.encode_name}` | `{escaped(_type(each.type))}` | {escaped(given)} |")
    return f"### {struct.__name__}\n\n{paragraphs(struct.__doc__)}\n\n{shape}{tag}.\n\n" + "\n".join(lines)


def _type(annotation: Any) -> str:
    text = (
        annotation.__name__ if isinstance(annotation, type) and not hasattr(annotation, "__args__") else str(annotation)
    )
    return re.sub(r"\b(?:zwerm\.protocol|typing|msgspec)\.", "", text)


# --- the command line -----------------------------------------------------------------------------------------------


def commands() -> str:
    """Return every command with its arguments and options."""
    group: Any = typer.main.get_command(app)
    return "\n\n".join(_command(name, each) for name, each in group.commands.items())


def _command(name: str, command: Any) -> str:
    lines = [heading(f"`zwerm {name}`", f"command-{name}"), _plain(command.help)]
    table = ["| | |", "| --- | --- |"] if command.params else []
    for each in command.params:
        names = each.metavar or each.name.upper() if each.param_type_name == "argument" else ", ".join(each.opts)
        takes = f" {each.metavar}" if each.param_type_name == "option" and each.metavar else ""
        off = f" / {', '.join(each.secondary_opts)}" if each.secondary_opts else ""
        table.append(f"| `{names}{takes}{off}` | {escaped(_plain(each.help))} |")
    return "\n\n".join([*lines, "\n".join(table)])


def _plain(text: str | None) -> str:
    """Return help text as Markdown: a paragraph that is a command is code."""
    return re.sub(r"^\x08\n +(.*)$", r"`\1`", inspect.cleandoc(text or ""), flags=re.MULTILINE)


GALLERY: Final = Path(__file__).parent / "images" / "gallery"


def gallery() -> str:
    """Return every picture of the gallery, by algorithm, with the summary of its scenario."""
    parts = []
    for row in ALGORITHMS:
        scenarios = [
            name for name, file in built_in().items() if row_of(file) is row and (GALLERY / f"{name}.png").exists()
        ]
        if scenarios:
            page = f"\n\nPaper: {row.paper}. [Page]({row.page})." if row.page else ""
            parts.append(f"## {row.title}{page}")
        for name in scenarios:
            summary = load(name).summary
            parts.append(f"### `{name}`\n\n{summary}.\n\n![{summary}](images/gallery/{name}.png)")
    return "\n\n".join(parts)


def metric_groups() -> list[tuple[str, type[Metric]]]:
    """Return every metric class of the catalogue, with the key or the title of the algorithm that switches it on."""
    groups = [(f"`[metrics] {key}`", where) for key, where in METRICS.items()]
    groups += [(row.title, where) for row in ALGORITHMS for where in row.metrics]
    return [(switch, class_named(where, "metric", METRICS)) for switch, where in groups]


def metric_list() -> str:
    """Return every group of metrics: the key or the algorithm that switches it on, its names, and its summary."""
    lines = ["| measured with | metrics | what they measure |", "| --- | --- | --- |"]
    for switch, found in metric_groups():
        shown = ", ".join(f"`{each}`" for each in found.names)
        lines.append(f"| {switch} | {shown} | {escaped(first_paragraph(found.__doc__))} |")
    return "\n".join(lines)


def metric_meanings() -> str:
    """Return every metric of the catalogue: its name, what it means, and the key or the algorithm that switches it on."""
    lines = ["| metric | what it is | measured with |", "| --- | --- | --- |"]
    for switch, found in metric_groups():
        assert isinstance(found.names, Mapping), f"{found.__qualname__}: the names of a metric need meanings"
        lines += [f"| `{name}` | {escaped(text)} | {switch} |" for name, text in found.names.items()]
    return "\n".join(lines)


GENERATED: Final[dict[str, Callable[[], str]]] = {
    "built-in-scenarios": built_in_scenarios,
    "commands": commands,
    "controllers": controller_list,
    "fields": field_list,
    "faults": fault_list,
    "gallery": gallery,
    "messages": messages,
    "object-fields": object_fields,
    "public-names": public_names,
    "metrics": metric_list,
    "metric-meanings": metric_meanings,
    "parts": part_list,
    "radio-models": radio_models,
    "scenario-tables": scenario_tables,
    "sensors": sensor_list,
    "study-tables": study_tables,
}
