"""Geometry that sensors and metrics share: visibility, Voronoi neighbours, walls by cell, quadrature."""
