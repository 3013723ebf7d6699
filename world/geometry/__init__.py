"""Geometry for sensors and metrics: visibility, Voronoi neighbours, an index of walls, quadrature."""
