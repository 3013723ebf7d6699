"""The measurements of a run: the metrics of every run, those of its observers, and telemetry."""

from zwerm.run.assembly import observers_of
from zwerm.scenario.tables import Scenario
from zwerm.world.metrics import Truth
from zwerm.world.metrics.observers import ENGINE_NAMES, RADIO_NAMES, TELEMETRY_NAMES, Observers
from zwerm.world.radio.report import messages, radio_metrics
from zwerm.world.world import World


def truth_of(world: World) -> Truth:
    """Return the true state of a world now, as metrics see it."""
    return Truth(world.scene, world.dead, world.completed, world.telemetry, messages(world.medium))


def metric_names(scenario: Scenario, observers: Observers) -> list[str]:
    """Return the names of all metrics that runs of a scenario may have; `*` in a name stands for any characters."""
    names = [*ENGINE_NAMES, *observers.names, TELEMETRY_NAMES]
    return [*names, *RADIO_NAMES] if _has_radio(scenario) else names


def measure(world: World, observers: Observers | None = None) -> dict[str, float]:
    """Return the metrics of a world at its end, by name; those of telemetry cannot replace any other.

    `observers` sampled the run; without them, new ones sample its end.
    """
    scenario = world.scenario
    observers = observers or observers_of(scenario, world.scene.arena)
    found = {"robots_in_arena": float(world.scene.present.sum())}
    if scenario.robots.entrance is not None:
        found["robots_exited"] = float(len(world.bodies.exited))
    found |= observers.finish(truth_of(world))
    if world.schedule.faults:
        found["faults_missed"] = float(len(world.schedule.missed))
    if _has_radio(scenario):
        found["robots_done_fraction"] = world.completion.done_fraction
        found |= radio_metrics(world.medium, scenario.robots.count, world.tick)
    return {**found, **world.telemetry.metrics()}


def _has_radio(scenario: Scenario) -> bool:
    return scenario.radio is not None or scenario.coordinator is not None
