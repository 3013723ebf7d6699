"""Radio models by name: those of the catalogue, and `module:Class` for any other.

Input: the shorthands and the `models` tables of a channel. Output: the models in the order of the scenario, or every mistake in
the tables at once. The shorthands come first: range, line of sight, loss.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import ValidationError

from zwerm.catalogue import RADIO_MODELS
from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.plugin_names import class_named, takes
from zwerm.scenario.tables import ChannelTable, Scenario
from zwerm.scenario.types import OpenTable
from zwerm.world.arena.arena import Arena
from zwerm.world.radio import (
    ROBOTS,
    ModelContext,
    PacketJudge,
    Packets,
    RadioModel,
    RadioModelTable,
    Transmissions,
    Verdict,
)
from zwerm.world.radio.links import Links
from zwerm.world.radio.nodes import node_count, selected
from zwerm.world.scene import Bools


class Selected:
    """Applies a model to the packets from some senders to some receivers only."""

    def __init__(self, model: RadioModel, senders: Bools, receivers: Bools) -> None:
        self.cause = model.cause
        self.out_of_reach = model.out_of_reach
        self.memoryless = model.memoryless
        self._model = model
        self._senders = senders
        self._receivers = receivers

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Return the verdict of the model; other packets are not affected."""
        chosen = np.flatnonzero(self._senders[packets.sender] & self._receivers[packets.receiver])
        if not len(chosen):
            return Verdict()
        verdict = self._model.judge(sent, packets.take(chosen))

        def spread(values: Any, others: Any) -> Any:
            if values is None:
                return None
            whole = np.array(np.broadcast_to(others, len(packets)), dtype=values.dtype)
            whole[chosen] = values
            return whole

        return Verdict(
            spread(verdict.drop, False),
            spread(verdict.after_s, 0.0),
            spread(verdict.copies, 0),
            spread(verdict.payload, packets.payload),
            spread(verdict.attenuation_db, 0.0),
        )


def find(kind: str) -> type[RadioModel]:
    """Return the model class that `kind` names.

    Raises ValueError, in one line, if there is none or it is no radio model.
    """
    found = class_named(RADIO_MODELS.get(kind, kind), "model", RADIO_MODELS)
    if not callable(getattr(found, "judge", None)):
        raise ValueError(f"{kind} is no radio model: it has no method judge(sent, packets)")
    parameters = getattr(found, "Parameters", RadioModelTable)
    if not isinstance(parameters, type) or not issubclass(parameters, RadioModelTable):
        raise ValueError(f"{kind} is no radio model: its `Parameters` must be a subclass of RadioModelTable")
    if not takes(found, 2):
        raise ValueError(f"{kind} is no radio model: its constructor must take (parameters, context)")
    # A class with the same methods need not inherit: it gets the defaults of the base class behind its own attributes.
    return found if issubclass(found, RadioModel) else type(found.__name__, (found, RadioModel), {})


def make_models(
    scenario: Scenario, names: Sequence[str], links: Mapping[str, Links], arena: Arena, draws: Draws
) -> dict[str, tuple[list[PacketJudge], Links]]:
    """Return the models of each channel of `names`, in order, and the links of the channel.

    Raises ScenarioError with every mistake in every table, each `path: rule, got value`.
    """
    found: list[str] = []
    made: dict[str, tuple[list[PacketJudge], Links]] = {}
    for name in names:
        table: ChannelTable | None = scenario.radio if name == ROBOTS else scenario.uplink
        path = "radio" if name == ROBOTS else "uplink"
        models: list[PacketJudge] = []
        counts: Counter[str] = Counter()
        context = ModelContext(links[name], draws, f"radio/{name}", node_count(scenario), scenario.time.dt_s, arena)
        for where, model in [] if table is None else tables_of(table, path):
            try:
                models.append(make_model(model, context, scenario, where, counts))
            except ScenarioError as error:
                found += error.mistakes
        made[name] = models, links[name]
    if scenario.uplink is not None and scenario.coordinator is None:
        found.append("uplink: leads to the coordinator, and the scenario has none")
    if found:
        raise ScenarioError(found)
    return made


def make_model(
    table: OpenTable, context: ModelContext, scenario: Scenario, path: str, counts: Counter[str]
) -> PacketJudge:
    """Return the model that `table` at `path` describes. `counts` has the number of earlier models of the channel by key.

    Raises ScenarioError with every mistake.
    """
    try:
        kind = find(table.kind)
        if kind.needs_positions and not path.startswith("radio"):
            raise ValueError(f"the coordinator has no position: no {table.kind} to it, got {table.kind!r}")
    except ValueError as error:
        raise ScenarioError([f"{path}.kind: {error}"]) from None
    key = kind.draw_key or table.kind
    counts[key] += 1
    try:
        parameters = kind.Parameters.model_validate(table.parameters)
    except ValidationError as error:
        named = f"{scenario.place}: "
        lines = mistakes(error, scenario.place, f"{path}.", kind.Parameters)
        raise ScenarioError([line.removeprefix(named) for line in lines]) from None
    wrong: list[str] = []
    senders = selected(parameters.senders, scenario, f"{path}.senders", wrong)
    receivers = selected(parameters.receivers, scenario, f"{path}.receivers", wrong)
    if wrong:
        raise ScenarioError(wrong)
    purpose = f"{context.purpose}/{key}/{parameters.name or counts[key]}"
    here = ModelContext(context.links, context.draws, purpose, context.nodes, context.dt_s, context.arena)
    try:
        model = kind(parameters, here)
    except ValueError as error:
        raise ScenarioError([f"{path}: {error}"]) from None
    if parameters.senders is None and parameters.receivers is None:
        return model
    return Selected(model, senders, receivers)


def tables_of(table: ChannelTable, path: str) -> list[tuple[str, OpenTable]]:
    """Return the models of a channel in order, shorthands first, each as (path, table)."""
    found = []
    range_m, line_of_sight = getattr(table, "range_m", None), getattr(table, "line_of_sight", False)
    if range_m is not None:
        found.append((f"{path}.range_m", OpenTable.model_validate({"kind": "range", "range_m": range_m})))
    if line_of_sight:
        found.append((f"{path}.line_of_sight", OpenTable.model_validate({"kind": "line_of_sight"})))
    if table.loss:
        found.append((f"{path}.loss", OpenTable.model_validate({"kind": "loss", "fraction": table.loss})))
    return [*found, *((f"{path}.models.{index}", model) for index, model in enumerate(table.models))]
