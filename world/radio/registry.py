"""The radio's models by name: the built-in table, and `module:Class` for anyone else's.

A channel's shorthands and its `models` tables go in; models in the order of the scenario come out, or every mistake in the
tables at once. The shorthands come first: range, line of sight, loss.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final

import numpy as np
from pydantic import ValidationError

from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.plugin_names import class_named
from zwerm.scenario.tables import ChannelTable, Scenario
from zwerm.scenario.types import OpenTable
from zwerm.world.arena.arena import Arena
from zwerm.world.radio import ROBOTS, Air, LinkModel, LinkTable, ModelPlace, NodeName, Packets, Verdict
from zwerm.world.radio.links import Links
from zwerm.world.radio.models.collision import Collision
from zwerm.world.radio.models.corruption import Corruption
from zwerm.world.radio.models.delay import Delay
from zwerm.world.radio.models.duplication import Duplication
from zwerm.world.radio.models.gilbert_elliott import GilbertElliott
from zwerm.world.radio.models.line_of_sight import LineOfSightModel
from zwerm.world.radio.models.loss import Loss
from zwerm.world.radio.models.path_loss import PathLoss
from zwerm.world.radio.models.range import DiscRange
from zwerm.world.radio.models.rate_limit import RateLimit
from zwerm.world.radio.models.wall_attenuation import WallAttenuation
from zwerm.world.scene import Bools

BUILT_IN: Final[dict[str, type[LinkModel]]] = {
    model.kind: model
    for model in (
        *(
            DiscRange,
            LineOfSightModel,
            PathLoss,
            WallAttenuation,
            Loss,
            GilbertElliott,
            Delay,
            Duplication,
            Corruption,
            RateLimit,
            Collision,
        ),
    )
}


class Selected:
    """A model that judges only what some nodes send, or some receive."""

    kind: ClassVar[str] = "selected"
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = LinkTable

    def __init__(self, model: LinkModel, senders: Bools, receivers: Bools) -> None:
        self.cause = model.cause
        self.out_of_reach: bool = getattr(model, "out_of_reach", False)
        self.model = model
        self._senders = senders
        self._receivers = receivers

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Leave the others alone."""
        chosen = np.flatnonzero(self._senders[packets.sender] & self._receivers[packets.receiver])
        if not len(chosen):
            return Verdict()
        verdict = self.model.judge(air, packets.take(chosen))

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


def find(kind: str) -> type[LinkModel]:
    """Return the model class that `kind` names. Raises ValueError, in one line, where there is none."""
    if kind in BUILT_IN:
        return BUILT_IN[kind]
    found = class_named(kind, "model", BUILT_IN)
    if not callable(getattr(found, "judge", None)):
        raise ValueError(f"{kind} is no model: expected a class with a method judge(air, packets)")
    return found


def make_models(
    scenario: Scenario, names: Sequence[str], links: Mapping[str, Links], arena: Arena, draws: Draws
) -> dict[str, tuple[list[LinkModel], Links]]:
    """Return the models of each channel of `names`, in order, and the channel's links.

    Raises ScenarioError with every mistake in every table, each `path: rule, got value`.
    """
    found: list[str] = []
    made: dict[str, tuple[list[LinkModel], Links]] = {}
    for name in names:
        table: ChannelTable | None = scenario.radio if name == ROBOTS else scenario.uplink
        path = "radio" if name == ROBOTS else "uplink"
        models: list[LinkModel] = []
        counts: Counter[str] = Counter()
        for where, model in [] if table is None else tables_of(table, path):
            counts[model.kind] += 1
            place = ModelPlace(
                links[name], draws, f"radio/{name}/{model.kind}", _nodes(scenario), scenario.time.dt_s, arena
            )
            try:
                models.append(make_model(model, place, scenario, where, counts[model.kind], name == ROBOTS))
            except ScenarioError as error:
                found += error.mistakes
        made[name] = models, links[name]
    if scenario.uplink is not None and scenario.coordinator is None:
        found.append("uplink: leads to the coordinator, and the scenario has none")
    if found:
        raise ScenarioError(found)
    return made


def make_model(
    table: OpenTable, place: ModelPlace, scenario: Scenario, path: str, number: int, has_positions: bool
) -> LinkModel:
    """Return the `number`-th model of its kind on a channel, as `table` at `path` describes it.

    Raises ScenarioError with every mistake.
    """
    try:
        kind = find(table.kind)
        if kind.needs_positions and not has_positions:
            raise ValueError(f"the coordinator is nowhere: no {table.kind} to it, got {table.kind!r}")
    except ValueError as error:
        raise ScenarioError([f"{path}.kind: {error}"]) from None
    try:
        parameters = kind.Parameters.model_validate(table.parameters)
    except ValidationError as error:
        named = f"{scenario.place}: "
        found = [line.removeprefix(named) for line in mistakes(error, scenario.place, f"{path}.")]
        raise ScenarioError(found) from None
    purpose = f"{place.purpose}/{parameters.name or number}"
    wrong: list[str] = []
    chosen = []
    for key in ("senders", "receivers"):
        names: list[NodeName] | None = getattr(parameters, key)
        chosen.append(selected(names, scenario, f"{path}.{key}", wrong))
    if wrong:
        raise ScenarioError(wrong)
    try:
        here = ModelPlace(place.links, place.draws, purpose, place.nodes, place.dt_s, place.arena)
        model = kind(parameters, here)
    except ValueError as error:
        raise ScenarioError([f"{path}: {error}"]) from None
    if parameters.senders is None and parameters.receivers is None:
        return model
    return Selected(model, *chosen)  # type: ignore[return-value]


def selected(names: Sequence[NodeName] | None, scenario: Scenario, path: str, wrong: list[str]) -> Bools:
    """Return (nodes,) who is named, everyone if `names` is None; add a line to `wrong` for each that does not exist."""
    if names is None:
        return np.ones(_nodes(scenario), dtype=np.bool_)
    chosen = np.zeros(_nodes(scenario), dtype=np.bool_)
    for index, name in enumerate(names):
        try:
            chosen[node_id(name, scenario)] = True
        except ValueError as error:
            wrong.append(f"{path}.{index}: {error}")
    return chosen


def node_id(name: NodeName, scenario: Scenario) -> int:
    """Return the id of the node that `name` names. Raises ValueError, in one line, where there is none."""
    count = scenario.robots.count
    if name == "coordinator":
        if scenario.coordinator is None:
            raise ValueError("the scenario has no coordinator")
        return count
    if name == "base":
        if scenario.base is None:
            raise ValueError("the scenario has no base station")
        return 0
    if not 0 <= name < count:
        raise ValueError(f"no such robot: ids are 0 to {count - 1}, got {name}")
    return name


def _nodes(scenario: Scenario) -> int:
    return scenario.robots.count + (scenario.coordinator is not None)


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
