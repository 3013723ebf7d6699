"""The journal of an evolution: one line of JSON for each generation, so that an interrupted evolution continues.

The search is a function of its settings and of the fitness of all candidates so far. So fitness is all that is stored.
"""

import fcntl
import os
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import msgspec

from zwerm.errors import ScenarioError

_HEAD: Final = "evolution"
# Settings that may differ when an evolution continues: more runs, or more generations.
_GROWING: Final = ("runs", "generations")


class Journal:
    """The fitness of each generation's candidates, by run, in `path`.

    `final` holds the second evaluation of a run's last candidates, by run and number of generations.
    """

    def __init__(self, path: Path, settings: dict[str, Any]) -> None:
        """Raises ScenarioError where the file cannot be written, or is of other settings or in use."""
        self.path = path
        self.fitness: dict[int, list[list[float]]] = {}
        self.final: dict[tuple[int, int], list[float]] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("a+b", buffering=0)
        except OSError as error:
            raise ScenarioError([f"{path}: cannot be written: {error.strerror}"]) from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._replay({name: value for name, value in settings.items() if name not in _GROWING})
        except BlockingIOError:
            self._file.close()
            raise ScenarioError([f"{path}: another evolution is writing to it"]) from None
        except ScenarioError:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def add(self, run: int, generation: int, fitness: list[float]) -> None:
        """Store the fitness of the candidates of a run's next generation."""
        self.fitness.setdefault(run, []).append(fitness)
        self._write({"run": run, "generation": generation, "fitness": fitness})

    def add_final(self, run: int, generation: int, fitness: list[float]) -> None:
        """Store the second evaluation of the candidates of a run's last generation."""
        self.final[run, generation] = fitness
        self._write({"run": run, "final": generation, "fitness": fitness})

    def _write(self, line: dict[str, Any]) -> None:
        self._file.write(msgspec.json.encode(line) + b"\n")
        os.fsync(self._file.fileno())

    def _replay(self, settings: dict[str, Any]) -> None:
        self._file.seek(0)
        text = self._file.read()
        whole = text.rfind(b"\n") + 1
        if whole < len(text):  # the line that was written when the process died
            self._file.truncate(whole)
        try:
            lines: list[dict[str, Any]] = [msgspec.json.decode(line) for line in text[:whole].splitlines()]
            if not lines:
                self._write({_HEAD: settings})
                return
            held = lines[0][_HEAD]
            # Compared as JSON, in which a tuple is a list.
            asked = msgspec.json.decode(msgspec.json.encode(settings))
            for name in sorted(held.keys() | asked.keys()):
                if held.get(name) != asked.get(name):
                    rule = f"expected {name} = {held.get(name)}, as in this file, got {asked.get(name)}"
                    raise ScenarioError([f"{self.path}: {rule}; --out names another file"])
            for line in lines[1:]:
                if "final" in line:
                    self.final[line["run"], line["final"]] = line["fitness"]
                else:
                    self.fitness.setdefault(line["run"], []).append(line["fitness"])
        except (msgspec.DecodeError, KeyError, TypeError, AttributeError):
            raise ScenarioError([f"{self.path}: expected the journal of an evolution"]) from None
