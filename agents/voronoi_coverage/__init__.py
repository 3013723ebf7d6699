"""Voronoi coverage with sensory feedback (Schwager, McLurkin, Rus 2006), and its variants.

`coverage` is the algorithm as printed; `swarmbot` the paper's hardware experiment, with a limited range and no sense of
the boundary; `fixed_point` its integer arithmetic; `radio` learns neighbours from packets instead of sensing them.
"""

from zwerm.agents.voronoi_coverage.coverage import VoronoiCoverage

__all__ = ["VoronoiCoverage"]
