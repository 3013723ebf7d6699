"""Evolution by CMA-ES: runs of generations of candidates, each candidate judged by its mean fitness over the same arenas.

Procedure of Ozdemir 2019, section III: each run starts at a random point within the bounds. The candidates of each run's last
generation are judged again in other arenas, and the best of all runs is the result. All runs share the arenas of a
generation. Candidates and arenas follow from `seed`; the number of threads changes no result.
"""

import threading
from collections.abc import Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from typing import Any, Final, Protocol

import numpy as np

from zwerm.errors import MissingExtraError, ScenarioError
from zwerm.evolve.batch import Batch
from zwerm.evolve.genome import Genome, genome_of
from zwerm.evolve.journal import Journal
from zwerm.evolve.reactive_kernel import kernel_digest
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.world.scene import Floats

# The first step size, as a fraction of the range of each parameter.
_STEP_FRACTION: Final = 0.3
# Seeds of arenas are below this number, so that they can be given to `zwerm run --seed`.
_SEEDS: Final = 2**31


@dataclass(frozen=True)
class EvolutionSettings:
    """The scale of an evolution; by default that of Ozdemir 2019, section III.

    `runs` of `generations` of `population` candidates, each candidate in `trials` arenas; the last candidates in
    `final_trials`.
    """

    runs: int = 50
    generations: int = 500
    population: int = 12
    trials: int = 20
    final_trials: int = 200
    seed: int = 1


@dataclass(frozen=True)
class EvolutionResult:
    """The best candidate: its `parameters`, its run, and its fitness in the final trials.

    `fitness` holds the mean of each run's candidates by generation, `finals` the best final fitness of each run.
    """

    parameters: dict[str, Any]
    run: int
    best_fitness: float
    fitness: list[list[float]]
    finals: list[float]
    interrupted: bool = False


class EvolutionListener(Protocol):
    """Receiver of an evolution's progress."""

    def begin(self, total: int, done: int) -> None:
        """Of `total` generations of all runs, `done` are in the journal."""

    def generation(self, run: int, best: float) -> None:
        """A generation of a run has ended; `best` is the fitness of its best candidate."""


class Evolution:
    """One evolution of a scenario's controller."""

    def __init__(self, scenario: Scenario, settings: EvolutionSettings) -> None:
        """Raises ScenarioError where the scenario has no batch or its controller no genome, and MissingExtraError."""
        mistakes = [f"{name}: expected >= 1, got {value}" for name, value in asdict(settings).items() if value < 1]
        if settings.population < 4:
            mistakes.append(f"population: expected >= 4, got {settings.population}")
        if mistakes:
            raise ScenarioError(list(dict.fromkeys(mistakes)))
        self.settings = settings
        self.genome: Genome = genome_of(scenario)
        self._batch = Batch(scenario)
        self._draws = Draws(settings.seed)
        self._stopped = threading.Event()
        self._lock = threading.Lock()
        try:
            from cmaes import CMA
        except ModuleNotFoundError as error:
            raise MissingExtraError(
                f"evolve: needs {error.name}; install it with: pip install 'zwerm[evolve]'"
            ) from None
        self._cma = CMA

    def identity(self) -> dict[str, Any]:
        """Return everything that decides the fitness of the candidates, for the journal."""
        scenario = self._batch.scenario.model_dump(mode="json", exclude={"summary", "source", "pictures"})
        scenario["robots"]["parameters"] = self.genome.others
        return asdict(self.settings) | {"scenario": scenario, "kernel": kernel_digest()}

    def run(self, journal: Journal, jobs: int = 1, listener: EvolutionListener | None = None) -> EvolutionResult | None:
        """Return the result of all runs, `jobs` at a time; after Ctrl-C that of the runs that have ended, or None.

        What the journal has is not simulated again.
        """
        settings = self.settings
        done = sum(min(len(journal.fitness.get(run, [])), settings.generations) for run in range(settings.runs))
        if listener is not None:
            listener.begin(settings.runs * settings.generations, done)
        interrupted = False
        with ThreadPoolExecutor(jobs, thread_name_prefix="evolution") as pool:
            futures = [pool.submit(self._one_run, run, journal, listener) for run in range(settings.runs)]
            try:
                wait(futures, return_when=FIRST_EXCEPTION)
            except KeyboardInterrupt:
                interrupted = True
            finally:
                self._stopped.set()
                pool.shutdown(cancel_futures=True)
        ended = {run: future.result() for run, future in enumerate(futures) if not future.cancelled()}
        finals = {run: found for run, found in ended.items() if found is not None}
        if not finals:
            return None
        best = max(finals, key=lambda run: finals[run][1].max())
        candidates, fitness = finals[best]
        return EvolutionResult(
            self.genome.parameters(candidates[int(np.argmax(fitness))].tolist()),
            best + 1,
            float(fitness.max()),
            [
                [float(np.mean(each)) for each in journal.fitness.get(run, [])[: settings.generations]]
                for run in sorted(finals)
            ],
            [float(finals[run][1].max()) for run in sorted(finals)],
            interrupted,
        )

    def _one_run(
        self, run: int, journal: Journal, listener: EvolutionListener | None
    ) -> tuple[list[Floats], Floats] | None:
        """Return the candidates of the last generation and their final fitness, or None where the run was stopped."""
        settings, genome = self.settings, self.genome
        least, span = genome.bounds[:, 0], genome.bounds[:, 1] - genome.bounds[:, 0]
        # The search is in units of each parameter's range.
        start = self._draws.uniform("evolution-start", run, np.arange(len(genome.names)))
        seed = int(self._draws.bits("evolution-search", run)) % _SEEDS
        unit = np.array([[0.0, 1.0]] * len(span))
        search = self._cma(start, _STEP_FRACTION, bounds=unit, seed=seed, population_size=settings.population)
        held = journal.fitness.get(run, [])[: settings.generations]
        candidates: list[Floats] = []
        for generation in range(settings.generations):
            points = [search.ask() for _ in range(settings.population)]
            candidates = [least + span * point for point in points]
            if generation < len(held):
                fitness = held[generation]
            else:
                if self._stopped.is_set():
                    return None
                fitness = self._judged(
                    candidates, self._seeds("evolution-arenas", settings.trials, generation)
                ).tolist()
                with self._lock:
                    journal.add(run, generation, fitness)
                    if listener is not None:
                        listener.generation(run, max(fitness))
            search.tell([(point, -value) for point, value in zip(points, fitness, strict=True)])
        final = journal.final.get((run, settings.generations))
        if final is None:
            if self._stopped.is_set():
                return None
            final = self._judged(candidates, self._seeds("evolution-final", settings.final_trials)).tolist()
            with self._lock:
                journal.add_final(run, settings.generations, final)
        return candidates, np.array(final)

    def _seeds(self, purpose: str, trials: int, *ids: int) -> list[int]:
        words = self._draws.bits(purpose, *ids, np.arange(trials)) % np.uint64(_SEEDS)
        return [int(word) for word in words]

    def _judged(self, candidates: Sequence[Floats], seeds: Sequence[int]) -> Floats:
        """Return the mean fitness of each candidate over the arenas of `seeds`."""
        parameters = [self.genome.parameters(each.tolist()) for each in candidates]
        with self._lock:  # start positions are drawn once
            self._batch.draw_starts(seeds)
        result = self._batch.run([each for each in parameters for _ in seeds], list(seeds) * len(candidates))
        mean: Floats = self._batch.fitness(result).reshape(len(candidates), len(seeds)).mean(axis=1)
        return mean
