"""Pure mathematics, with numpy at most: angles, keyed random numbers, polygons, simplicial complexes, statistics."""
