"""Picture layers, one file each: those of the algorithms, and those that a scenario asks for."""
