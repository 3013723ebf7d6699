"""Voronoi coverage with sensory feedback (Schwager, McLurkin, Rus 2006), and its variants.

`coverage` is the algorithm as printed; `swarmbot` the paper's hardware experiment, with a limited range and without a
boundary sensor; `fixed_point` its integer arithmetic; `radio` gets neighbours from packets instead of a sensor, and
`quadratic` estimates the field from the values of neighbours.
"""

from zwerm.agents.voronoi_coverage.coverage import VoronoiCoverage
from zwerm.agents.voronoi_coverage.fixed_point import IntegerCoverage
from zwerm.agents.voronoi_coverage.radio import RadioCoverage
from zwerm.agents.voronoi_coverage.swarmbot import SwarmBotCoverage

__all__ = ["IntegerCoverage", "RadioCoverage", "SwarmBotCoverage", "VoronoiCoverage"]
