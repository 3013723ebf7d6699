"""A crash of robots that are chosen by where they are, once some are there."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.faults.programs.crash import Crash
from zwerm.world.scene import Ints, Scene


class ChosenCrash(Crash):
    """The robots that `choose` returns first crash for good."""

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return no mistake."""
        return []

    def strike(self, scene: Scene, dead: Sequence[int]) -> Sequence[int]:
        """Return the robots that crash now: none once any have."""
        if self.nodes:
            return ()
        self.nodes = self.choose(scene, np.setdiff1d(scene.present_ids(), [0, *dead]))
        return self.nodes

    @abstractmethod
    def choose(self, scene: Scene, robots: Ints) -> list[int]:
        """Return those of the living `robots` (n,), without the base, that crash."""
