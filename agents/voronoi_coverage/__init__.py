"""Voronoi coverage with sensory feedback (Schwager, McLurkin, Rus 2006), and its variants.

`coverage` is the algorithm as printed; `swarmbot` the paper's hardware experiment, with a limited range and no sense of
the boundary; `fixed_point` its integer arithmetic; `radio` learns neighbours from packets instead of sensing them, and
`quadratic` estimates the field from what they say.
"""

from zwerm.agents.voronoi_coverage.coverage import VoronoiCoverage
from zwerm.agents.voronoi_coverage.fixed_point import IntegerCoverage
from zwerm.agents.voronoi_coverage.radio import RadioCoverage
from zwerm.agents.voronoi_coverage.swarmbot import SwarmBotCoverage

__all__ = ["IntegerCoverage", "RadioCoverage", "SwarmBotCoverage", "VoronoiCoverage"]
