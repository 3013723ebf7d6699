"""Spatial coverage without computation (Ozdemir, Gauci, Kolling, Hall, Gross 2019), and the random walk it is compared with."""

from zwerm.agents.computation_free.random_walk import RandomWalk
from zwerm.agents.computation_free.reactive import ComputationFree

__all__ = ["ComputationFree", "RandomWalk"]
