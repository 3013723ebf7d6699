"""Conditions for the beginning of a fault, evaluated once a tick until they are met."""

from zwerm.scenario.tables import Scenario
from zwerm.world.faults import WhenTable
from zwerm.world.metrics.position_coverage import area_coverage_fraction, cell_counts, cell_coverage_fraction
from zwerm.world.scene import Scene


class Condition:
    """The condition that `table` describes. The scenario must measure the metric of the condition."""

    def __init__(self, table: WhenTable, scenario: Scenario) -> None:
        self._table = table
        self._metrics = scenario.metrics

    def met(self, scene: Scene) -> bool:
        """Return whether it holds now."""
        table, metrics = self._table, self._metrics
        if table.robot_deployed is not None:
            return bool(scene.present[table.robot_deployed])
        position = scene.position[scene.present]
        reached = 0.0
        if table.metric == "cell_coverage_fraction" and metrics.cells is not None:
            reached = cell_coverage_fraction(cell_counts(position, scene.arena.bounds, metrics.cells))
        elif metrics.coverage_radius_m is not None:
            reached = area_coverage_fraction(position, metrics.coverage_radius_m, scene.arena)
        return reached >= (table.at_least or 0.0)
